drawHead();
setUpStage();
setUpPlot();
drawTable();
const ofFrames = frames.length > 1 ? " Seconds are of the whole sequence, errors of its last frame but where a column says otherwise." : "";
byId("table-note").textContent = `Green: the least of its column.${ofFrames} ${errorsText(sweep.reference)}`;
setUpExpected();
setUpPairs();
setUpNodes();
setUpTexts();
byId("save-left").addEventListener("click", () => saveSide(state.left));
byId("save-right").addEventListener("click", () => saveSide(state.right));
change(readLink());
drawPlot();
window.addEventListener("hashchange", () => change(readLink()));
window.addEventListener("resize", () => { layOut(); drawPlot(); drawCourse(); showOverflow(); });

// Tables that reach beyond their frame fade there.

function showOverflow() {
  for (const frame of document.querySelectorAll(".scroller")) {
    frame.classList.toggle("before", frame.scrollLeft > 1);
    frame.classList.toggle("beyond", frame.scrollLeft + frame.clientWidth < frame.scrollWidth - 1);
  }
}

document.querySelectorAll(".scroller").forEach((frame) => frame.addEventListener("scroll", showOverflow));
showOverflow();

drawHead();
setUpStage();
setUpPlot();
drawTable();
byId("table-note").textContent = `Green: the least of its column. ${errorsText(sweep.reference)}`;
setUpExpected();
setUpPairs();
setUpNodes();
setUpTexts();
byId("save-left").addEventListener("click", () => saveSide(state.left));
byId("save-right").addEventListener("click", () => saveSide(state.right));
change(readLink());
drawPlot();
window.addEventListener("hashchange", () => change(readLink()));
window.addEventListener("resize", () => { layOut(); drawPlot(); showOverflow(); });

// Tables that reach beyond their frame fade there.

function showOverflow() {
  for (const frame of document.querySelectorAll(".scroller")) {
    frame.classList.toggle("before", frame.scrollLeft > 1);
    frame.classList.toggle("beyond", frame.scrollLeft + frame.clientWidth < frame.scrollWidth - 1);
  }
}

document.querySelectorAll(".scroller").forEach((frame) => frame.addEventListener("scroll", showOverflow));
showOverflow();

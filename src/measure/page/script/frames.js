// Frames of a sequence: all pictures are of the same one, which plays or is looked for; below, how errors go from frame to frame

/** Shown once its pictures are unpacked: until then the one before stays. */
let frameWanted = frameShown;
let playing = null;

function goToFrame(frame) {
  frameWanted = Math.min(Math.max(frame, 0), frames.length - 1);
  if (!showWanted()) draw();
}

/** Shows the frame that is wanted, if it is another and is there. */
function showWanted() {
  if (frameWanted === frameShown || !isUnpacked(frameWanted)) return false;
  frameShown = frameWanted;
  draw();
  drawRecordLegend();
  drawCourse();
  showFrame();
  // The one after it is the likeliest to come.
  isUnpacked((frameShown + 1) % frames.length);
  return true;
}

/** Whether what the stage shows of a frame is there; if not, it is on its way. */
function isUnpacked(frame) {
  const choice = isDifference(state.layer) ? `shown ${partsOf(state.layer)[1]}` : state.layer;
  // All of them are begun.
  return [state.left, state.right].map((index) => planesOf(choice, index, frame)).every((planes) => planes !== undefined);
}

function showFrame() {
  const { moment } = frames[frameShown];
  byId("frame").value = frameShown;
  byId("frame").setAttribute("aria-valuetext", `frame ${moment.frame}`);
  byId("frame-told").value = `frame ${moment.frame}, ${moment.seconds.toFixed(3)} s`;
}

/** Plays as fast as the sequence goes, or as pictures can be drawn; stops where it plays. */
function play() {
  if (frames.length < 2) return;
  if (playing !== null) cancelAnimationFrame(playing);
  playing = playing === null ? requestAnimationFrame((now) => turn(now, now, frameShown)) : null;
  byId("play").textContent = playing === null ? "Play" : "Stop";
}

function turn(now, since, from) {
  const due = from + Math.floor((now - since) / 1000 / frameSeconds());
  if (frameWanted === frameShown && due !== from) {
    goToFrame((frameShown + 1) % frames.length);
    // A frame that came late delays those after it.
    playing = requestAnimationFrame((next) => turn(next, due > from + 1 ? now : since + 1000 * frameSeconds(), frameShown));
  } else playing = requestAnimationFrame((next) => turn(next, since, from));
}

function setUpFrames() {
  if (frames.length < 2) return;
  byId("frames").hidden = false;
  document.querySelectorAll(".of-frames").forEach((line) => { line.hidden = false; });
  byId("frame").max = frames.length - 1;
  byId("frame").addEventListener("input", () => goToFrame(Number(byId("frame").value)));
  byId("play").addEventListener("click", play);
  showFrame();
  setUpCourse();
}

// Lines over the frames

const COURSE_ERRORS = { rmse_over_mean: "error", bias_over_mean: "bias", block_p50: "median error of blocks", block_p99: "99th percentile of blocks' errors", flicker: "flicker" };
const COURSE_COUNTS = { seconds: "Seconds", records: "Records", new_records: "New records" };
/** As those of the plot. */
const LINE_COLOURS = ["#0072b2", "#c44e00", "#00805c", "#b0568a", "#8a6d00", "#6b6fd0"];
const COURSE_HEIGHT = 200;
let courseShown = null;

/** What a variant has in each frame; null where it is not known. */
function courseOf({ courses, frames: of_frames }, choice) {
  const [layer, name] = partsOf(choice);
  if (layer) return courses?.[layer]?.frames.map((frame) => frame[name] ?? null) ?? [];
  return (of_frames ?? []).map((frame) => (name === "seconds" ? frame.seconds.median : frame[name] ?? null));
}

const courseTold = (choice, value) => (value === null || value === undefined ? "–" : partsOf(choice)[0] ? percent(value) : figures(value));

function courseChoices() {
  const errors = COURSE_LAYERS.flatMap((layer) => Object.entries(COURSE_ERRORS).map(([name, label]) => [`${layer} ${name}`, `${headingOf(layer)}: ${label}`]));
  const counts = Object.entries(COURSE_COUNTS).map(([name, label]) => [` ${name}`, label]);
  return [...errors, ...counts].filter(([choice]) => variants.some((variant) => courseOf(variant, choice).some((value) => value !== null)));
}

function setUpCourse() {
  const choices = courseChoices();
  if (choices.length === 0) return;
  byId("course-section").hidden = false;
  courseShown = (choices.find(([choice]) => choice === "picture rmse_over_mean") ?? choices[0])[0];
  fillSelect(byId("course-of"), choices, courseShown, (choice) => { courseShown = choice; drawCourse(); });
  byId("course-note").textContent = "Errors are shares of the reference's mean in that frame. Flicker is what changes from a frame to the next beyond the reference's own change. Click or drag to go to a frame.";
}

/** Round numbers from `low` to `high`, five at most. */
function courseTicks(low, high) {
  const least = (high - low) / 4;
  const power = 10 ** Math.floor(Math.log10(least));
  const step = [1, 2, 5, 10].map((times) => times * power).find((size) => size >= least * 0.999);
  return Array.from({ length: Math.floor(high / step + 1e-6) - Math.ceil(low / step - 1e-6) + 1 }, (_, at) => (Math.ceil(low / step - 1e-6) + at) * step);
}

function drawCourse() {
  if (courseShown === null) return;
  const lines = variants.map((variant) => courseOf(variant, courseShown));
  const known = lines.flat().filter((value) => value !== null);
  const [low, high] = [Math.min(0, ...known), Math.max(0, ...known)];
  const top = high > low ? high : low + 1;
  const [left, right, bottom] = [64, Math.max(byId("course").clientWidth - 10, 65), COURSE_HEIGHT - 24];
  const x = (place) => left + (place / (frames.length - 1)) * (right - left);
  const y = (value) => bottom - ((value - low) / (top - low)) * (bottom - 10);
  const rules = courseTicks(low, top).flatMap((tick) => [
    makeSvg("line", { class: "grid", x1: left, x2: right, y1: y(tick), y2: y(tick) }),
    makeSvg("text", { x: left - 8, y: y(tick) + 4, "text-anchor": "end" }, courseTold(courseShown, tick)),
  ]);
  const ends = [0, frames.length - 1].map((place) => makeSvg("text", { x: x(place), y: COURSE_HEIGHT - 6, "text-anchor": place ? "end" : "start" }, `frame ${frames[place].moment.frame}`));
  const path = (line) => line.map((value, place) => (value === null ? "" : `${place && line[place - 1] !== null ? "L" : "M"}${x(place).toFixed(1)},${y(value).toFixed(1)}`)).join("");
  const paths = lines.map((line, index) => makeSvg("path", { class: "line", d: path(line), stroke: LINE_COLOURS[index % LINE_COLOURS.length] }));
  const now = makeSvg("line", { class: "now", x1: x(frameShown), x2: x(frameShown), y1: 4, y2: bottom });
  const at = (event) => Math.round(((event.clientX - event.currentTarget.getBoundingClientRect().left - left) / (right - left)) * (frames.length - 1));
  const seek = (event) => { if (event.buttons === 1) goToFrame(at(event)); };
  const label = byId("course-of").selectedOptions[0].textContent;
  const svg = makeSvg("svg", { height: COURSE_HEIGHT, role: "img", "aria-label": `${label}, frame by frame`, onpointerdown: seek, onpointermove: seek }, ...rules, ...ends, ...paths, now);
  byId("course").replaceChildren(svg);
  const entry = (variant, index) => make("li", {}, make("i", { style: `background: ${LINE_COLOURS[index % LINE_COLOURS.length]}` }), `${titleOf(index)}: ${courseTold(courseShown, lines[index][frameShown])}`);
  byId("course-legend").replaceChildren(...variants.map(entry));
}

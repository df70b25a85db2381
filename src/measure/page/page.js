"use strict";
(() => {
// What was found, as the program wrote it. Nothing of it is ever read as HTML: it reaches the page as text alone.
const { report, gallery } = JSON.parse(document.getElementById("data").textContent);
const { sweep, beside, charts, differences } = report;
const variants = sweep.points;
const [WIDTH, HEIGHT] = sweep.size;
const REFERENCE = variants.length;
const MOST_SCALE = 64;

const byId = (id) => document.getElementById(id);

/** An element with attributes, listeners (`on…`) and children: elements or text. */
function make(tag, attributes = {}, ...children) {
  return furnish(document.createElement(tag), attributes, children);
}

function makeSvg(tag, attributes = {}, ...children) {
  return furnish(document.createElementNS("http://www.w3.org/2000/svg", tag), attributes, children);
}

function furnish(element, attributes, children) {
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (value !== null && value !== undefined && value !== false) element.setAttribute(name, value === true ? "" : value);
  }
  element.append(...children.filter((child) => child !== null && child !== undefined));
  return element;
}

/** A number of three figures, or all before its point. */
function figures(value, count = 3) {
  if (value === null || value === undefined) return "–";
  if (value === 0) return "0";
  const digits = Math.min(Math.max(count - 1 - Math.floor(Math.log10(Math.abs(value))), 0), 6);
  return value.toFixed(digits).replace("-", "−");
}

const percent = (share) => (share === null || share === undefined ? "–" : `${figures(100 * share)} %`);
const valuesOf = (variant) => sweep.over.map(({ parameter }) => `${parameter}=${variant.values[parameter]}`);
const nameOf = (variant) => [variant.row, ...valuesOf(variant)].join(" ");
const titleOf = (index) => (index === REFERENCE ? "Reference" : `${variants[index].id}  ${nameOf(variants[index])}`);

/** A group of radio buttons that looks like one control. */
function choice(fieldset, options, chosen, onchange) {
  for (const [value, label, disabled] of options) {
    const input = make("input", { type: "radio", name: fieldset.id, value, checked: value === chosen, disabled, onchange: () => onchange(value) });
    fieldset.append(make("label", {}, input, make("span", {}, label)));
  }
}

const checkIn = (fieldset, value) => fieldset.querySelectorAll("input").forEach((input) => { input.checked = input.value === value; });

// Head

function drawHead() {
  byId("title").textContent = report.title;
  const runs = sweep.runs === report.runs_asked ? `${sweep.runs}` : `${sweep.runs} of ${report.runs_asked} asked for`;
  const facts = [
    ["Camera", sweep.camera],
    ["Size", `${WIDTH}×${HEIGHT}`],
    ["Triangles", sweep.triangles.toLocaleString("en")],
    ["Adapter", `${sweep.adapter.name} (${sweep.adapter.backend})`],
    ["Runs of each", runs],
    ["Reference", referenceText(sweep.reference)],
  ];
  byId("facts").append(...facts.map(([name, value]) => make("div", {}, make("dt", {}, name), make("dd", {}, value))));
  byId("warnings").append(...report.warnings.map((warning) => make("li", {}, warning)));
  byId("warnings").hidden = report.warnings.length === 0;
}

function referenceText(reference) {
  if (!reference) return "none";
  if (reference.row) return `${reference.row}, at the same values`;
  return reference.samples ? `${reference.samples} rays a pixel` : "given";
}

// Pictures, decoded when they are first shown

const decoded = new Map();

/** The canvas of a picture or map: undefined while it is being decoded, null where there is none. */
function bitmap(layer, index) {
  const key = `${layer} ${index}`;
  if (!decoded.has(key)) {
    const image = imageOf(layer, index);
    decoded.set(key, image ? undefined : null);
    if (image) decode(layer, image).then((canvas) => { decoded.set(key, canvas); draw(); });
  }
  return decoded.get(key);
}

const mapSet = (layer) => gallery.maps.find((set) => set.layer === layer);

function imageOf(layer, index) {
  if (layer === "shown") return index === REFERENCE ? gallery.reference : gallery.pictures[index];
  return index === REFERENCE ? null : mapSet(layer)?.images[index];
}

async function decode(layer, image) {
  const canvas = await load(image);
  if (layer !== "shown") return colour(canvas, mapSet(layer));
  return image.from_first ? addTo(canvas, await load(gallery.pictures[0])) : canvas;
}

async function load(image) {
  const element = new Image();
  element.src = image.source;
  await element.decode();
  const canvas = make("canvas", { width: image.width, height: image.height });
  canvas.getContext("2d", { willReadFrequently: true }).drawImage(element, 0, 0);
  canvas.block = image.block;
  return canvas;
}

/** Pictures are kept as differences from the first, each byte modulo 256. */
function addTo(canvas, first) {
  const context = canvas.getContext("2d");
  const sum = context.getImageData(0, 0, canvas.width, canvas.height);
  const other = first.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
  for (let at = 0; at < sum.data.length; at += 4) {
    for (let channel = at; channel < at + 3; channel += 1) sum.data[channel] = (sum.data[channel] + other[channel]) & 255;
  }
  context.putImageData(sum, 0, 0);
  return canvas;
}

/** Blue is too dark, red too bright, the middle right; the farther the brighter. */
const DIVERGING = [[150, 214, 255], [58, 138, 220], [30, 60, 120], [22, 25, 29], [122, 34, 30], [222, 92, 52], [255, 214, 140]];

/** The colour of an error, -1 to 1 of the scale. */
function colourOf(error) {
  const place = ((error + 1) / 2) * (DIVERGING.length - 1);
  const below = Math.min(Math.floor(place), DIVERGING.length - 2);
  return DIVERGING[below].map((channel, index) => channel + (DIVERGING[below + 1][index] - channel) * (place - below));
}

/** The error of a map's byte, -1 to 1 of its scale; null where there is no surface. */
const errorOf = (byte, set) => (byte === 0 ? null : (byte - 1 - set.levels) / set.levels);

function colour(canvas, set) {
  const context = canvas.getContext("2d");
  const pixels = context.getImageData(0, 0, canvas.width, canvas.height);
  canvas.levels = new Uint8Array(canvas.width * canvas.height);
  const palette = Array.from({ length: 256 }, (_, byte) => (byte === 0 || byte > 2 * set.levels + 1 ? [70, 74, 79] : colourOf(errorOf(byte, set))));
  for (let at = 0; at < canvas.levels.length; at += 1) {
    canvas.levels[at] = pixels.data[4 * at];
    pixels.data.set(palette[canvas.levels[at]], 4 * at);
  }
  context.putImageData(pixels, 0, 0);
  return canvas;
}

// The stage: one canvas, so that both sides are always in step

const stage = byId("stage");
const canvas = byId("canvas");
const slider = byId("slider");
const LAYERS = ["shown", "irradiance", "picture"];
const VIEWS = [["slider", "Slider"], ["side", "Side by side"], ["flip", "Flip"]];
const second = variants.length > 1 ? 1 : gallery.reference ? REFERENCE : 0;
/** `scale`: pixels of the page a pixel of the picture, null for the whole picture; `x`, `y`: the picture's point in the middle. */
const state = { left: 0, right: second, layer: "shown", view: "slider", split: 0.5, flipped: false, scale: null, x: WIDTH / 2, y: HEIGHT / 2, hover: null };

const paneCount = () => (state.view === "side" ? 2 : 1);

function panes() {
  const width = stage.clientWidth / paneCount();
  return { width, height: stage.clientHeight, fit: Math.min(width / WIDTH, stage.clientHeight / HEIGHT) };
}

const scaleNow = () => state.scale ?? panes().fit;

/** Gives the stage its height, then draws. */
function layOut() {
  stage.style.height = `${Math.round(Math.min(((stage.clientWidth / paneCount()) * HEIGHT) / WIDTH, 0.8 * window.innerHeight))}px`;
  moveTo(state.x, state.y);
}

function draw() {
  const ratio = window.devicePixelRatio || 1;
  const [width, height] = [stage.clientWidth, stage.clientHeight].map((side) => Math.max(Math.round(side * ratio), 1));
  if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, stage.clientWidth, stage.clientHeight);
  const pane = panes();
  const border = state.split * pane.width;
  if (state.view === "side") {
    drawPane(context, state.left, 0, 0, pane.width - 1, pane);
    drawPane(context, state.right, pane.width, pane.width + 1, 2 * pane.width, pane);
  } else if (state.view === "flip") {
    drawPane(context, state.flipped ? state.right : state.left, 0, 0, pane.width, pane);
  } else {
    drawPane(context, state.left, 0, 0, border, pane);
    drawPane(context, state.right, 0, border, pane.width, pane);
  }
  showState(border);
}

/** Draws into a pane that begins at `origin`, between the columns `from` and `to`. */
function drawPane(context, index, origin, from, to, pane) {
  const source = bitmap(state.layer, index);
  if (!source) return;
  const scale = scaleNow();
  context.save();
  context.beginPath();
  context.rect(from, 0, Math.max(to - from, 0), pane.height);
  context.clip();
  context.imageSmoothingEnabled = scale * (window.devicePixelRatio || 1) < 1;
  context.imageSmoothingQuality = "high";
  // The last of its blocks may reach beyond the picture.
  const part = [WIDTH / source.block, HEIGHT / source.block];
  context.drawImage(source, 0, 0, ...part, origin + pane.width / 2 - state.x * scale, pane.height / 2 - state.y * scale, WIDTH * scale, HEIGHT * scale);
  context.restore();
}

function showState(border) {
  const alone = state.view === "flip";
  const shown = state.flipped ? state.right : state.left;
  byId("left-label").textContent = titleOf(alone ? shown : state.left);
  byId("left-label").classList.toggle("alone", alone);
  byId("right-label").textContent = titleOf(state.right);
  byId("right-label").hidden = alone;
  slider.hidden = state.view !== "slider";
  slider.style.left = `${border}px`;
  slider.setAttribute("aria-valuenow", Math.round(100 * state.split));
  slider.setAttribute("aria-valuetext", `${Math.round(100 * state.split)} % ${titleOf(state.left)}, the rest ${titleOf(state.right)}`);
  stage.classList.toggle("zoomed", state.scale !== null);
  byId("zoom").textContent = `${figures(100 * scaleNow() * (window.devicePixelRatio || 1))} %`;
  const visible = alone ? [shown] : [state.left, state.right];
  stage.setAttribute("aria-busy", visible.some((index) => bitmap(state.layer, index) === undefined));
  showAbsent(visible);
  showReadout();
}

const STATES = { refused: "was refused", open: "is not measured yet" };

function showAbsent(indices) {
  const lacking = [...new Set(indices)].filter((index) => bitmap(state.layer, index) === null);
  const reason = (index) => {
    if (state.layer === "shown") return `${titleOf(index)} ${STATES[variants[index]?.state] ?? "has no picture"}`;
    return index === REFERENCE ? "The reference has no error of its own" : `${titleOf(index)} has no ${state.layer} whose error could be mapped`;
  };
  byId("absent").textContent = lacking.map(reason).join("; ");
  byId("absent").hidden = lacking.length === 0;
}

function showReadout() {
  const readout = byId("readout");
  if (!state.hover) {
    readout.textContent = "";
    return;
  }
  const { x, y } = state.hover;
  const value = (index) => `${index === REFERENCE ? "reference" : variants[index].id} ${valueAt(index, x, y)}`;
  readout.textContent = `x ${x}, y ${y}   ${value(state.left)}   ${value(state.right)}`;
}

function valueAt(index, x, y) {
  const source = bitmap(state.layer, index);
  if (!source) return "–";
  const [column, row] = [x, y].map((place) => Math.floor(place / source.block));
  if (state.layer === "shown") return [...source.getContext("2d").getImageData(column, row, 1, 1).data.slice(0, 3)].join(" ");
  const set = mapSet(state.layer);
  const error = errorOf(source.levels[row * source.width + column], set);
  if (error === null) return "no surface";
  return `${Math.abs(error) === 1 ? (error > 0 ? "≥ " : "≤ ") : ""}${error > 0 ? "+" : ""}${percent(error * set.scale)}`;
}

/** The mean of a block holds less noise than each of its pixels. */
function noiseOf(set) {
  const noise = variants.map((variant) => variant.errors?.[set.layer]?.reference_noise_over_mean).find((found) => found);
  return noise ? ` The reference's noise, ${percent(noise / set.block)}, is in it.` : " The reference's noise is in it.";
}

function drawScale() {
  const set = mapSet(state.layer);
  byId("scale").hidden = !set;
  if (!set) return;
  const context = byId("scale-bar").getContext("2d");
  for (let x = 0; x < 256; x += 1) {
    context.fillStyle = `rgb(${colourOf((2 * x) / 255 - 1).map(Math.round).join(" ")})`;
    context.fillRect(x, 0, 1, 1);
  }
  const tick = (share) => `${share > 0 ? "+" : ""}${percent(share * set.scale)}`;
  byId("scale-ticks").replaceChildren(...[-1, -0.5, 0, 0.5, 1].map((share) => make("span", {}, tick(share))));
  const blocks = set.block > 1 ? `, means of ${set.block}×${set.block} pixels` : "";
  byId("scale-text").textContent = `Too dark (blue) and too bright (red), as a share of the reference's mean ${set.layer}${blocks}. Grey: no surface.${noiseOf(set)}`;
}

// What moves the stage

function change(changes) {
  Object.assign(state, changes);
  byId("left").value = state.left;
  byId("right").value = state.right;
  byId("layer").value = state.layer;
  checkIn(byId("view"), state.view);
  drawScale();
  layOut();
  markShown();
}

/** Shows a variant's picture on the right, beside what is on the left. */
function open(index) {
  change({ right: index, left: state.left === index ? state.right : state.left, flipped: true });
  byId("pictures").scrollIntoView({ block: "start" });
  stage.focus({ preventScroll: true });
}

function markShown() {
  document.querySelectorAll("[data-variant]").forEach((element) => element.classList.toggle("shown", Number(element.dataset.variant) === state.right));
}

function zoomTo(scale, at = { x: state.x, y: state.y }) {
  const { fit } = panes();
  const before = scaleNow();
  const after = Math.min(Math.max(scale, Math.min(fit, 1 / (window.devicePixelRatio || 1))), MOST_SCALE);
  const keep = (middle, point) => point - ((point - middle) * before) / after;
  state.scale = Math.abs(after / fit - 1) < 1e-3 ? null : after;
  moveTo(keep(state.x, at.x), keep(state.y, at.y));
}

/** Moves the middle, and keeps the picture in the pane. */
function moveTo(x, y) {
  const { width, height } = panes();
  const scale = scaleNow();
  const inside = (value, side, room) => (side * scale <= room ? side / 2 : Math.min(Math.max(value, room / 2 / scale), side - room / 2 / scale));
  Object.assign(state, { x: inside(x, WIDTH, width), y: inside(y, HEIGHT, height) });
  draw();
}

const fitAll = () => { state.scale = null; moveTo(WIDTH / 2, HEIGHT / 2); };
const onePixel = () => zoomTo(1 / (window.devicePixelRatio || 1));
const moveSlider = (split) => { state.split = Math.min(Math.max(split, 0), 1); draw(); };
const flip = () => change(state.view === "flip" ? { flipped: !state.flipped } : { view: "flip", flipped: true });
const swap = () => change({ left: state.right, right: state.left });

/** The picture's point under a pointer. */
function under(event) {
  const box = stage.getBoundingClientRect();
  const { width, height } = panes();
  const scale = scaleNow();
  const column = (event.clientX - box.left) % width;
  return { x: state.x + (column - width / 2) / scale, y: state.y + (event.clientY - box.top - height / 2) / scale };
}

const pointers = new Map();
let drag = null;
let splitBefore = state.split;

function pressed(event) {
  if (event.button !== 0) return;
  pointers.set(event.pointerId, event);
  stage.setPointerCapture(event.pointerId);
  if (pointers.size > 1) {
    // The first finger of two was not for the slider.
    drag = "picture";
    moveSlider(splitBefore);
    return;
  }
  splitBefore = state.split;
  const onSlider = event.target.closest("#slider") !== null;
  drag = state.view === "slider" && (onSlider || state.scale === null) ? "slider" : "picture";
  if (onSlider) slider.focus({ preventScroll: true });
  if (drag === "slider") slide(event);
}

function slide(event) {
  const box = stage.getBoundingClientRect();
  moveSlider((event.clientX - box.left) / box.width);
}

function moved(event) {
  hover(event);
  const before = pointers.get(event.pointerId);
  if (!before) return;
  const others = [...pointers.values()].filter((other) => other.pointerId !== event.pointerId);
  pointers.set(event.pointerId, event);
  if (others.length > 0) pinch(before, event, others[0]);
  else if (drag === "slider") slide(event);
  else if (state.scale !== null) moveTo(state.x - (event.clientX - before.clientX) / scaleNow(), state.y - (event.clientY - before.clientY) / scaleNow());
}

function pinch(before, now, other) {
  const distance = (event) => Math.max(Math.hypot(event.clientX - other.clientX, event.clientY - other.clientY), 1);
  zoomTo((scaleNow() * distance(now)) / distance(before), under({ clientX: (now.clientX + other.clientX) / 2, clientY: (now.clientY + other.clientY) / 2 }));
}

function released(event) {
  pointers.delete(event.pointerId);
  if (pointers.size === 0) drag = null;
}

function hover(event) {
  const point = under(event);
  const [x, y] = [Math.floor(point.x), Math.floor(point.y)];
  state.hover = x >= 0 && y >= 0 && x < WIDTH && y < HEIGHT ? { x, y } : null;
  showReadout();
}

function wheel(event) {
  if (!event.ctrlKey && !event.metaKey) return;
  event.preventDefault();
  zoomTo(scaleNow() * Math.exp(-Math.min(Math.max(event.deltaY, -200), 200) / 250), under(event));
}

const step = (list, now, by) => list[(list.indexOf(now) + by + list.length) % list.length];

function nextRight(by) {
  const indices = [...byId("right").options].map((option) => Number(option.value));
  change({ right: step(indices, state.right, by) });
}

function nextLayer() {
  const there = LAYERS.filter((layer) => layer === "shown" || mapSet(layer));
  change({ layer: step(there, state.layer, 1) });
}

const KEYS = {
  f: flip,
  x: swap,
  v: () => change({ view: step(VIEWS.map(([name]) => name), state.view, 1) }),
  e: nextLayer,
  "[": () => nextRight(-1),
  "]": () => nextRight(1),
  "+": () => zoomTo(scaleNow() * 1.5),
  "=": () => zoomTo(scaleNow() * 1.5),
  "-": () => zoomTo(scaleNow() / 1.5),
  0: fitAll,
  1: onePixel,
  h: () => moveTo(state.x - panes().width / 8 / scaleNow(), state.y),
  l: () => moveTo(state.x + panes().width / 8 / scaleNow(), state.y),
  k: () => moveTo(state.x, state.y - panes().height / 8 / scaleNow()),
  j: () => moveTo(state.x, state.y + panes().height / 8 / scaleNow()),
  "?": () => { byId("keys").open = !byId("keys").open; },
};

const SLIDES = { ArrowLeft: -1, ArrowRight: 1 };

function key(event) {
  if (event.ctrlKey || event.metaKey || event.altKey || event.target.closest("select")) return;
  const onStage = event.target === document.body || stage.contains(event.target);
  if (onStage && state.view === "slider" && event.key in SLIDES) moveSlider(state.split + SLIDES[event.key] * (event.shiftKey ? 0.1 : 0.01));
  else if (event.target === slider && event.key === "Home") moveSlider(0);
  else if (event.target === slider && event.key === "End") moveSlider(1);
  else if (Object.hasOwn(KEYS, event.key)) KEYS[event.key]();
  else return;
  event.preventDefault();
}

function fillSelect(select, options, chosen, onchange) {
  select.append(...options.map(([value, label, disabled]) => make("option", { value, disabled, selected: value === chosen }, label)));
  select.addEventListener("change", () => onchange(select.value));
}

function layerOptions() {
  const because = (layer) => (sweep.reference ? `the reference and a pipeline must both hold it` : "no reference was given");
  const map = (layer, label) => [layer, mapSet(layer) ? label : `${label}: ${because(layer)}`, !mapSet(layer)];
  return [["shown", "Pictures"], map("irradiance", "Error of the irradiance"), map("picture", "Error of the picture")];
}

function setUpStage() {
  const sides = variants.map((_, index) => [index, titleOf(index)]);
  if (gallery.reference) sides.push([REFERENCE, titleOf(REFERENCE)]);
  fillSelect(byId("left"), sides, state.left, (value) => change({ left: Number(value), flipped: false }));
  fillSelect(byId("right"), sides, state.right, (value) => change({ right: Number(value), flipped: true }));
  fillSelect(byId("layer"), layerOptions(), state.layer, (layer) => change({ layer }));
  choice(byId("view"), VIEWS, state.view, (view) => change({ view }));
  const buttons = { swap, fit: fitAll, pixels: onePixel, "zoom-in": KEYS["+"], "zoom-out": KEYS["-"] };
  for (const [id, action] of Object.entries(buttons)) byId(id).addEventListener("click", action);
  const listeners = { pointerdown: pressed, pointermove: moved, pointerup: released, pointercancel: released, pointerleave: () => { state.hover = null; showReadout(); } };
  for (const [name, listener] of Object.entries(listeners)) stage.addEventListener(name, listener);
  stage.addEventListener("wheel", wheel, { passive: false });
  stage.addEventListener("dblclick", (event) => (state.scale === null ? zoomTo(4 / (window.devicePixelRatio || 1), under(event)) : fitAll()));
  document.addEventListener("keydown", key);
  const exposure = `${gallery.exposure >= 0 ? "+" : "−"}${Math.abs(gallery.exposure).toFixed(2)}`;
  const block = Math.max(...gallery.pictures.map((image) => image?.block ?? 1));
  const kept = block > 1 ? `as means of ${block}×${block} pixels: so many whole ones are too heavy for a page.` : "without further loss.";
  byId("lossless").textContent = `All pictures are tone-mapped alike, at ${exposure} stops, and kept as 8 bits a channel ${kept}`;
}

// The plot of error over cost

const NARROW = 600;
const errorText = (value, chart) => (chart.is_share ? percent(value) : figures(value));
const drawing = { chart: 0, svg: null };

function drawPlot() {
  if (charts.length === 0) {
    const because = sweep.reference ? "No point shares a layer with the reference" : "No reference was given";
    byId("plot").replaceChildren(make("p", { class: "missing" }, `${because}: errors are not known. The table below holds the times.`));
    return;
  }
  const chart = charts[drawing.chart];
  const svg = byId("plot").clientWidth < NARROW ? chart.narrow : chart.wide;
  if (drawing.svg === svg) return;
  drawing.svg = svg;
  const figure = document.importNode(new DOMParser().parseFromString(svg, "image/svg+xml").documentElement, true);
  furnish(figure, { role: "group" }, []);
  const marks = [...figure.querySelectorAll(".mark")];
  marks.forEach(makeButton);
  byId("plot").replaceChildren(figure);
  const shown = new Set(marks.map((mark) => mark.dataset.id));
  const without = variants.map((variant) => variant.id).filter((id) => !shown.has(id));
  const left = without.length ? ` Not shown, for their error or cost is not known: ${without.join(", ")}.` : "";
  const signed = chart.errors.some((error) => error < 0) ? " Sizes of the errors, without their signs." : "";
  byId("plot-note").textContent = `Ringed points lie on the Pareto front: none costs less and is closer. A point opens its picture on the right.${signed}${left}`;
  markShown();
}

function makeButton(mark) {
  const index = variants.findIndex((variant) => variant.id === mark.dataset.id);
  const told = mark.querySelector("title").textContent;
  const best = mark.querySelector(".ring") ? ", on the Pareto front" : "";
  const press = (event) => { if (event.key === "Enter" || event.key === " ") { event.preventDefault(); open(index); } };
  furnish(mark, { tabindex: 0, role: "button", "aria-label": `${told}${best}; opens its picture`, "data-variant": index, onclick: () => open(index), onkeydown: press }, []);
  mark.prepend(makeSvg("circle", { class: "target", r: 14 }));
}

function setUpPlot() {
  byId("plot-title").textContent = `Error over ${sweep.cost === "seconds" ? "time" : sweep.cost}`;
  fillSelect(byId("metric"), charts.map((chart, index) => [index, chart.label]), 0, (index) => { drawing.chart = Number(index); drawPlot(); });
  byId("metric").closest(".tools").hidden = charts.length === 0;
}

// The table

const pairs = differences?.pairs ?? [];
const pairWith = (first, second) => pairs.find((pair) => pair.first === first && pair.second === second);
const counted = (value) => (value === null ? "–" : String(value));

/** Values of a parameter are sorted as numbers where all are. */
function axisColumn({ parameter, values }) {
  const areNumbers = values.every((value) => value.trim() !== "" && Number.isFinite(Number(value)));
  return { name: parameter, value: ({ values }) => (areNumbers ? Number(values[parameter]) : values[parameter]), text: (_, { values }) => values[parameter], words: !areNumbers };
}

/** Name, tooltip, value to sort by, text; `least` where a small value is the better one. A column that knows nothing is left out. */
const COLUMNS = [
  { name: "", tip: "Opens the picture", value: (_, index) => index },
  { name: "Pipeline", value: (variant) => variant.row, text: (value) => value, words: true },
  ...sweep.over.map(axisColumn),
  { name: "State", value: (variant) => (variant.state === "measured" ? null : variant.because ? `refused: ${variant.because}` : variant.state), text: (value) => value ?? "measured", words: true },
  { name: "Seconds", tip: "Median of the runs", value: (variant) => variant.seconds?.median ?? null, text: (value) => figures(value), least: true },
  { name: "Quartiles", value: ({ seconds }) => (seconds ? seconds.upper_quartile - seconds.lower_quartile : null), text: (_, { seconds }) => (seconds ? `${figures(seconds.lower_quartile)} … ${figures(seconds.upper_quartile)}` : "–") },
  { name: `× ${variants[0]?.id}`, tip: "Time over that of the first; in brackets where no more than noise", value: (variant, index) => (index ? pairWith(variants[0].id, variant.id)?.ratio ?? null : pairs.length ? 1 : null), text: ratioText },
  { name: sweep.cost, tip: "What errors are held against", value: (_, index) => report.costs[index] ?? null, text: (value) => figures(value), least: true },
  { name: "Front", tip: `On the Pareto front of ${sweep.metric} over ${sweep.cost}`, value: (variant) => (sweep.over.length === 0 ? null : variant.pareto ? 0 : 1), text: (value) => (value === 0 ? "●" : "") },
  { name: "Records", value: (variant) => variant.records?.irradiance ?? null, text: counted },
  { name: "Uncovered", tip: "Pixels that see a surface that no record covers", value: (variant) => variant.uncovered_pixels ?? null, text: counted },
  { name: "Device MiB", value: (variant) => (variant.peak_gpu_bytes ? variant.peak_gpu_bytes / 2 ** 20 : null), text: (value) => figures(value), least: true },
  { name: "Start-up s", tip: "Plan, shaders, first picture", value: (_, index) => beside[index].start_up_seconds, text: (value) => figures(value) },
  ...charts.map((chart) => ({ name: chart.label, value: (_, index) => chart.errors[index], text: (value) => errorText(value, chart), least: true, sized: true })),
].filter((column) => variants.some((variant, index) => column.value(variant, index) !== null));

function ratioText(value, variant, index) {
  if (value === null || index === 0) return value === null ? "–" : "1";
  return pairWith(variants[0].id, variant.id).significant ? figures(value) : `(${figures(value)})`;
}

const sorting = { column: 0, ascending: true };

function sortBy(column) {
  sorting.ascending = sorting.column === column ? !sorting.ascending : true;
  sorting.column = column;
  drawTable();
}

/** By value, what is not known always last. */
function sorted() {
  const { value, sized } = COLUMNS[sorting.column];
  const rows = variants.map((variant, index) => ({ index, value: value(variant, index) }));
  const sign = sorting.ascending ? 1 : -1;
  const size = (row) => (sized && typeof row.value === "number" ? Math.abs(row.value) : row.value);
  const order = (a, b) => (typeof a === "string" ? a.localeCompare(b) : a - b);
  return rows.sort((a, b) => (a.value === null) - (b.value === null) || (a.value === null ? 0 : sign * order(size(a), size(b))) || a.index - b.index).map((row) => row.index);
}

function leastOf(column) {
  const values = variants.map(column.value).filter((value) => value !== null).map(Math.abs);
  return column.least && variants.length > 1 ? Math.min(...values) : null;
}

function drawTable() {
  const heads = COLUMNS.map((column, index) => {
    const order = sorting.column === index ? (sorting.ascending ? "ascending" : "descending") : "none";
    const button = make("button", { type: "button", class: "sort", title: column.tip, "aria-label": column.name || "Letter", onclick: () => { sortBy(index); byId("table").querySelectorAll(".sort")[index].focus(); } }, column.name);
    return make("th", { scope: "col", class: column.words || index === 0 ? "text" : null, "aria-sort": order }, button);
  });
  byId("table").tHead.replaceChildren(make("tr", {}, ...heads));
  const leasts = COLUMNS.map(leastOf);
  byId("table").tBodies[0].replaceChildren(...sorted().map((index) => rowOf(index, leasts)));
  markShown();
}

function rowOf(index, leasts) {
  const variant = variants[index];
  const button = make("button", { type: "button", class: "open", "aria-label": `Open the picture of ${titleOf(index)}`, onclick: () => open(index) }, variant.id);
  const cells = COLUMNS.slice(1).map((column, place) => {
    const value = column.value(variant, index);
    const least = value !== null && Math.abs(value) === leasts[place + 1];
    return make("td", { class: [column.words ? "text" : "", least ? "least" : ""].join(" ").trim() || null, title: column.words ? value : null }, column.text(value, variant, index));
  });
  return make("tr", { "data-variant": index }, make("td", { class: "text" }, button), ...cells);
}

// Pairs

function drawPairs() {
  const of = byId("of").value;
  const shown = pairs.filter((pair) => of === "all" || pair.first === of || pair.second === of);
  const items = shown.map((pair) => make("li", { class: pair.significant ? "significant" : pair.ratio_interval ? null : "open" }, pair.words));
  byId("pairs").replaceChildren(...(items.length ? items : [make("li", {}, "One pipeline alone has nothing to differ from.")]));
}

function setUpPairs() {
  byId("pairs").closest("section").hidden = !differences;
  if (!differences) return;
  const few = variants.length <= 4;
  const options = [["all", "all"], ...variants.map((variant, index) => [variant.id, titleOf(index)])];
  fillSelect(byId("of"), options, few ? "all" : variants[0].id, drawPairs);
  byId("hint").textContent = differences.hint ?? "";
  drawPairs();
}

// Nodes

const HUES = ["#4c78a8", "#f58518", "#54a24b", "#e45756", "#72b7b2", "#b279a2", "#eeca3b", "#9d755d", "#ff9da6", "#6b6ecf", "#8ca252", "#17a2d6"];
const OTHER = "#8a8f96";
const CLOCKS = [["both", "Device + host"], ["gpu_ms", "Device"], ["cpu_ms", "Host"]];
const passesOf = (variant) => variant.passes ?? [];
const hasDevice = variants.some((variant) => passesOf(variant).some((pass) => pass.gpu_ms !== null));
let clock = hasDevice ? "both" : "cpu_ms";

const timeOf = (pass) => (clock === "both" ? (pass.gpu_ms ?? 0) + (pass.cpu_ms ?? 0) : pass[clock] ?? 0);

/** Every node's name, the costliest first. */
function nodeNames() {
  const sums = new Map();
  for (const pass of variants.flatMap(passesOf)) sums.set(pass.node, (sums.get(pass.node) ?? 0) + timeOf(pass));
  return [...sums].sort((a, b) => b[1] - a[1]).map(([name]) => name);
}

function drawBars() {
  const names = nodeNames();
  const hue = (name) => (names.indexOf(name) < HUES.length ? HUES[names.indexOf(name)] : OTHER);
  const sums = variants.map((variant) => passesOf(variant).reduce((sum, pass) => sum + timeOf(pass), 0));
  const most = Math.max(...sums, Number.MIN_VALUE);
  byId("bars").replaceChildren(...variants.flatMap((variant, index) => barOf(variant, index, sums[index], most, hue)));
  const coloured = names.slice(0, HUES.length).map((name) => [name, hue(name)]);
  const entries = names.length > HUES.length ? [...coloured, [`${names.length - HUES.length} more`, OTHER]] : coloured;
  const light = (name) => document.querySelectorAll(".part").forEach((part) => part.classList.toggle("lit", part.dataset.node === name));
  byId("bars-legend").replaceChildren(...entries.map(([name, fill]) => make("li", { onpointerenter: () => light(name), onpointerleave: () => light(null) }, furnish(make("i"), { style: `background:${fill}` }, []), name)));
}

function barOf(variant, index, sum, most, hue) {
  const parts = passesOf(variant).filter((pass) => timeOf(pass) > 0).sort((a, b) => timeOf(b) - timeOf(a));
  const told = (pass) => `${pass.node} (${pass.pass}): ${figures(timeOf(pass))} ms, ${pass.runs} runs`;
  const pieces = parts.map((pass) => make("div", { class: "part", "data-node": pass.node, title: told(pass), style: `width:${(100 * timeOf(pass)) / most}%;background:${hue(pass.node)}` }));
  return [
    make("span", { class: "name", title: titleOf(index) }, titleOf(index)),
    make("span", { class: "sum" }, `${figures(sum)} ms`),
    make("div", { class: "track", role: "img", "aria-label": `${titleOf(index)}: ${parts.map(told).join("; ")}` }, ...pieces),
  ];
}

function drawNodes() {
  const names = [...new Map(variants.flatMap(passesOf).map((pass) => [`${pass.node} ${pass.pass}`, pass])).values()];
  const head = [make("th", { scope: "col", class: "text" }, "Node"), make("th", { scope: "col", class: "text" }, "Pass"), ...variants.map((variant) => make("th", { scope: "col", title: nameOf(variant) }, `${variant.id}, device + host ms`))];
  const cell = (pass) => (pass ? `${figures(pass.gpu_ms)} + ${figures(pass.cpu_ms)}` : "");
  const row = (name) => make("tr", {}, make("td", { class: "text" }, name.node), make("td", { class: "text" }, name.pass),
    ...variants.map((variant) => make("td", {}, cell(passesOf(variant).find((pass) => pass.node === name.node && pass.pass === name.pass)))));
  byId("nodes").tHead.replaceChildren(make("tr", {}, ...head));
  byId("nodes").tBodies[0].replaceChildren(...names.map(row));
}

function setUpNodes() {
  choice(byId("clock"), CLOCKS.map(([value, label]) => [value, label, value !== "cpu_ms" && !hasDevice]), clock, (value) => { clock = value; drawBars(); });
  byId("nodes-note").textContent = `Medians over the runs.${hasDevice ? "" : " This adapter does not tell the device's times."}`;
  drawBars();
  drawNodes();
}

// Texts

/** The lines of both in order: [" ", line], ["-", only in the first], ["+", only in the second]. */
function difference(first, second) {
  const common = Array.from({ length: first.length + 1 }, () => new Uint32Array(second.length + 1));
  for (let a = first.length - 1; a >= 0; a -= 1) {
    for (let b = second.length - 1; b >= 0; b -= 1) {
      common[a][b] = first[a] === second[b] ? common[a + 1][b + 1] + 1 : Math.max(common[a + 1][b], common[a][b + 1]);
    }
  }
  const lines = [];
  let [a, b] = [0, 0];
  while (a < first.length || b < second.length) {
    if (a < first.length && b < second.length && first[a] === second[b]) { lines.push([" ", first[a]]); a += 1; b += 1; }
    else if (b === second.length || (a < first.length && common[a + 1][b] >= common[a][b + 1])) { lines.push(["-", first[a]]); a += 1; }
    else { lines.push(["+", second[b]]); b += 1; }
  }
  return lines;
}

/** Leaves out what is far from any change, but for lines that say which node a change is in. */
function shorten(lines, around = 2) {
  const near = new Set();
  const keep = (index) => { for (let at = index - around; at <= index + around; at += 1) near.add(at); };
  let node = 0;
  lines.forEach(([sign, line], index) => {
    if (line.includes("(name: ")) node = index;
    if (sign !== " ") { keep(index); near.add(node); }
  });
  const shown = [];
  let left = 0;
  const flush = () => { if (left) shown.push(["…", `${left} ${left === 1 ? "line" : "lines"} alike`]); left = 0; };
  lines.forEach((line, index) => { if (near.has(index)) { flush(); shown.push(line); } else left += 1; });
  flush();
  return shown;
}

const KINDS = { "+": "added", "-": "removed", "…": "skipped" };
let textAs = "difference";

function drawText() {
  const index = Number(byId("text-of").value);
  const variant = variants[index];
  const texts = beside.map(({ text }) => text.trimEnd().split("\n"));
  const whole = index === 0 || textAs === "whole";
  const lines = whole ? texts[index].map((line) => [" ", line]) : difference(texts[0], texts[index]);
  const same = !whole && lines.every(([sign]) => sign === " ");
  const shown = whole ? lines : shorten(lines);
  byId("text").replaceChildren(...shown.map(([sign, line]) => make("span", { class: KINDS[sign] }, `${sign} ${line}`)));
  const changes = variant.set.length ? `, with ${variant.set.join(", ")}` : "";
  const against = whole ? "" : same ? ` The same as ${variants[0].id}.` : ` + only here, - only in ${variants[0].id}.`;
  const left = beside[index].dropped;
  const dropped = left.length ? ` Dropped for this scene: ${left.map((node) => `${node.node} (${node.because})`).join("; ")}.` : "";
  byId("text-note").textContent = `${variant.pipeline}${changes}, every parameter written out.${against}${dropped}`;
}

function setUpTexts() {
  fillSelect(byId("text-of"), variants.map((_, index) => [index, titleOf(index)]), Math.min(1, variants.length - 1), drawText);
  choice(byId("text-as"), [["difference", `Difference from ${variants[0].id}`], ["whole", "Whole text"]], textAs, (value) => { textAs = value; drawText(); });
  byId("text-as").hidden = variants.length === 1;
  drawText();
}

drawHead();
setUpStage();
setUpPlot();
drawTable();
byId("table-note").textContent = sweep.reference ? "Green: the least of its column. Errors of the irradiance are corrected for the reference's noise." : "No reference was given: there are no errors. Green: the least of its column.";
setUpPairs();
setUpNodes();
setUpTexts();
change({});
drawPlot();
window.addEventListener("resize", () => { layOut(); drawPlot(); });
})();

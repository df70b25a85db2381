// The stage: one canvas, so that both sides are always in step

const stage = byId("stage");
const canvas = byId("canvas");
const slider = byId("slider");
/** Their names in the data and in words. */
const LAYERS = { irradiance: "irradiance", picture: "picture", glossy: "glossy light", direct: "direct light" };
/** What the stage can show: pictures and maps that are there. */
const CHOICES = ["shown picture", "irradiance", "picture", "shown glossy", "glossy", "shown direct", "direct"].filter((layer) => shownSet(layer) || mapSet(layer));
const VIEWS = [["slider", "Slider"], ["side", "Side by side"], ["flip", "Flip"]];
const second = variants.length > 1 ? 1 : imageOf("shown picture", REFERENCE) ? REFERENCE : 0;
/** `scale`: pixels of the page a pixel of the picture, null for the whole picture; `x`, `y`: the picture's point in the middle. */
const state = { left: 0, right: second, layer: "shown picture", view: "slider", split: 0.5, flipped: false, scale: null, x: WIDTH / 2, y: HEIGHT / 2, hover: null };

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

/** Direct light may well be there: it is left out where a variant has indirect light to be judged by. */
const lackOf = (layer, use = "") => (layer === "direct" ? "is not judged by direct light" : `has no ${LAYERS[layer]}${use}`);

function showAbsent(indices) {
  const lacking = [...new Set(indices)].filter((index) => bitmap(state.layer, index) === null);
  const reason = (index) => {
    const shown = shownSet(state.layer);
    if (shown) return `${titleOf(index)} ${STATES[variants[index]?.state] ?? lackOf(shown.layer)}`;
    return index === REFERENCE ? "The reference has no error of its own" : `${titleOf(index)} ${lackOf(state.layer, " whose error could be mapped")}`;
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
  if (shownSet(state.layer)) return [...source.getContext("2d").getImageData(column, row, 1, 1).data.slice(0, 3)].join(" ");
  const set = mapSet(state.layer);
  const error = errorOf(source.levels[row * source.width + column], set);
  if (error === null) return "no surface";
  return `${Math.abs(error) === 1 ? (error > 0 ? "≥ " : "≤ ") : ""}${error > 0 ? "+" : ""}${percent(error * set.scale)}`;
}

/** The mean of a block holds less noise than each of its pixels. */
function noiseOf(set) {
  if (sweep.reference?.row) return "";
  const noise = variants.map((variant) => variant.errors?.[set.layer]?.reference_noise_over_mean).find((found) => found);
  return noise ? ` The reference's noise, ${percent(noise / set.block)}, is in it.` : " The reference's noise is in it.";
}

/** What else is not judged: in scenes with lobes, each kind of light has surfaces of its own. */
const GREY = gallery.shown.some((set) => set.layer === "glossy") ? { irradiance: ", or one without a diffuse part", glossy: ", or one without a lobe" } : {};

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
  byId("scale-text").textContent = `Too dark (blue) and too bright (red), as a share of the reference's mean ${LAYERS[set.layer]}${blocks}. Grey: no surface${GREY[set.layer] ?? ""}.${noiseOf(set)}`;
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
  change({ layer: step(CHOICES, state.layer, 1) });
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
  const error = (layer) => map(layer, `Error of the ${LAYERS[layer]}`);
  const others = gallery.shown.slice(1).flatMap(({ layer }) => [[`shown ${layer}`, `Pictures of the ${LAYERS[layer]}`], error(layer)]);
  return [["shown picture", "Pictures"], error("irradiance"), error("picture"), ...others];
}

function setUpStage() {
  const sides = variants.map((_, index) => [index, titleOf(index)]);
  if (imageOf("shown picture", REFERENCE)) sides.push([REFERENCE, titleOf(REFERENCE)]);
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
  const block = Math.max(...gallery.shown.flatMap(({ images }) => images.map((image) => image?.block ?? 1)));
  const kept = block > 1 ? `as means of ${block}×${block} pixels: so many whole ones are too heavy for a page.` : "without further loss.";
  byId("lossless").textContent = `All pictures are tone-mapped alike, at ${exposure} stops, and kept as 8 bits a channel ${kept}`;
}

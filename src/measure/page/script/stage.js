// The stage: one canvas, so that both sides are always in step

const stage = byId("stage");
const canvas = byId("canvas");
const slider = byId("slider");
/** Their names in the data and in words. */
const LAYERS = { irradiance: "irradiance", picture: "picture", glossy: "glossy light", direct: "direct light" };
const headingOf = (layer) => `${LAYERS[layer][0].toUpperCase()}${LAYERS[layer].slice(1)}`;
const UNITS = { irradiance: "W/m²" };
const unitOf = (layer) => UNITS[layer] ?? "W/(m²·sr)";
const hasTwo = variants.length > 1 || imageOf("shown picture", REFERENCE);
/** What the stage can show: light, and maps of errors, that are there. */
const CHOICES = gallery.shown.flatMap(({ layer }) => {
  const flips = layer === "picture" && gallery.flip ? [`flip ${layer}`] : [];
  return [`shown ${layer}`, ...(setOf.error(layer) ? [`error ${layer}`] : []), ...flips, ...(hasTwo ? [`difference ${layer}`, `relative ${layer}`] : [])];
});
/** Farthest from the exposure that shows all pictures well [stops]. */
const MOST_STOPS = 12;
const GAMMAS = [["", "sRGB"], ["1", "1, linear"], ["1.8", "1.8"], ["2.2", "2.2"], ["2.4", "2.4"]];
const VIEWS = [["slider", "Slider"], ["side", "Side by side"], ["flip", "Flip"]];
const second = variants.length > 1 ? 1 : imageOf("shown picture", REFERENCE) ? REFERENCE : 0;
/** `scale`: pixels of the page a pixel of the picture, null for the whole picture; `x`, `y`: the picture's point in the middle. */
const state = { left: 0, right: second, layer: "shown picture", view: "slider", split: 0.5, flipped: false, scale: null, x: WIDTH / 2, y: HEIGHT / 2, hover: null, pins: [], records: "" };

const paneCount = () => (state.view === "side" && !isDifference(state.layer) ? 2 : 1);

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
  if (isDifference(state.layer)) {
    // Both sides are in it.
    drawPane(context, state.left, 0, 0, stage.clientWidth, { ...pane, width: stage.clientWidth });
  } else if (state.view === "side") {
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
  const corner = [origin + pane.width / 2 - state.x * scale, pane.height / 2 - state.y * scale];
  context.drawImage(source, 0, 0, ...part, ...corner, WIDTH * scale, HEIGHT * scale);
  drawRecords(context, index, corner, scale, [from, 0, to, pane.height]);
  state.pins.forEach((pin) => outline(context, corner[0] + pin.x * scale, corner[1] + pin.y * scale, PIN_SIDE * scale));
  context.restore();
}

function outline(context, x, y, side) {
  for (const [width, colour] of [[3, "rgb(0 0 0 / 60%)"], [1, "#fff"]]) {
    Object.assign(context, { lineWidth: width, strokeStyle: colour });
    context.strokeRect(x, y, side, side);
  }
}

function showState(border) {
  const isOfBoth = isDifference(state.layer);
  const alone = state.view === "flip" || isOfBoth;
  const shown = state.flipped ? state.right : state.left;
  byId("left-label").textContent = isOfBoth ? `${titleOf(state.left)} less ${titleOf(state.right)}` : titleOf(alone ? shown : state.left);
  byId("left-label").classList.toggle("alone", alone);
  byId("right-label").textContent = titleOf(state.right);
  byId("right-label").hidden = alone;
  slider.hidden = state.view !== "slider" || isOfBoth;
  slider.style.left = `${border}px`;
  slider.setAttribute("aria-valuenow", Math.round(100 * state.split));
  slider.setAttribute("aria-valuetext", `${Math.round(100 * state.split)} % ${titleOf(state.left)}, the rest ${titleOf(state.right)}`);
  stage.classList.toggle("zoomed", state.scale !== null);
  byId("zoom").textContent = `${figures(100 * scaleNow() * (window.devicePixelRatio || 1))} %`;
  const visible = alone && !isOfBoth ? [shown] : [state.left, state.right];
  stage.setAttribute("aria-busy", frameWanted !== frameShown || visible.some((index) => bitmap(state.layer, index) === undefined));
  showAbsent(visible);
  showReadout();
  drawInsets();
  keepLink();
}

const STATES = { refused: "was refused", open: "is not measured yet" };

/** Direct light may well be there: it is left out where a variant has indirect light to be judged by. */
const lackOf = (layer, use = "") => (layer === "direct" ? "is not judged by direct light" : `has no ${LAYERS[layer]}${use}`);

function showAbsent(indices) {
  const [kind, layer] = partsOf(state.layer);
  // A difference lacks what one of its two lacks.
  const held = (index) => (isDifference(state.layer) ? planesOf(`shown ${layer}`, index) : bitmap(state.layer, index));
  const lacking = [...new Set(indices)].filter((index) => held(index) === null);
  const reason = (index) => {
    if (kind === "shown" || isDifference(state.layer)) return `${titleOf(index)} ${STATES[variants[index]?.state] ?? lackOf(layer)}`;
    return index === REFERENCE ? "The reference has no error of its own" : `${titleOf(index)} ${lackOf(layer, " whose error could be mapped")}`;
  };
  byId("absent").textContent = lacking.map(reason).join("; ");
  byId("absent").hidden = lacking.length === 0;
}

const letterOf = (index) => (index === REFERENCE ? "reference" : variants[index].id);

function showReadout() {
  const readout = byId("readout");
  if (!state.hover) {
    readout.textContent = "";
    return;
  }
  const [kind, layer] = partsOf(state.layer);
  const { x, y } = state.hover;
  const lights = [state.left, state.right].map((index) => `${letterOf(index)} ${lightAt(`shown ${layer}`, index, x, y)}`);
  const errors = [state.left, state.right].map((index) => `${letterOf(index)} ${errorAt(planesOf(state.layer, index), x, y)}`);
  const told = { shown: () => [...lights, unitOf(layer)], error: () => errors, flip: () => errors };
  const both = () => [errorAt(differenceOf(state.layer), x, y), ...lights, unitOf(layer)];
  const records = [...new Set([state.left, state.right])].flatMap((index) => recordAt(index, x, y));
  readout.textContent = [`x ${x}, y ${y}`, ...(told[kind] ?? both)(), ...records].join("   ");
}

const indexAt = (source, x, y) => Math.floor(y / source.block) * source.width + Math.floor(x / source.block);

/** Four figures, of any size. */
function exactly(value) {
  const size = Math.abs(value);
  return (size === 0 || (size >= 1e-3 && size < 1e5) ? figures(value, 4) : value.toExponential(3)).replace("-", "−");
}

function lightAt(choice, index, x, y) {
  const source = planesOf(choice, index);
  if (!source) return "–";
  const channels = [0, 1, 2].map((channel) => valueIn(source, channel, indexAt(source, x, y)));
  return channels.map(exactly).join(" ");
}

function errorAt(source, x, y) {
  if (!source) return "–";
  const at = indexAt(source, x, y);
  const error = source.errors ? source.errors[at] : valueIn(source, 0, at);
  if (Number.isNaN(error)) return source.errors ? "–" : "no surface";
  return state.layer.startsWith("flip") ? figures(error) : `${error > 0 ? "+" : ""}${percent(error)}`;
}

/** The mean of a block holds less noise than each of its pixels. */
function noiseOf(set) {
  if (sweep.reference?.row) return "";
  const noise = variants.map((variant) => variant.errors?.[set.layer]?.reference_noise_over_mean).find((found) => found);
  return noise ? ` The reference's noise, ${percent(noise / set.block)}, is in it.` : " The reference's noise is in it.";
}

/** What else is not judged: in scenes with lobes, each kind of light has surfaces of its own. */
const GREY = gallery.shown.some((set) => set.layer === "glossy") ? { irradiance: ", or one without a diffuse part", glossy: ", or one without a lobe" } : {};

const SCALE_TEXTS = {
  error: (set, layer) => `Too dark (blue) and too bright (red), as a share of the reference's mean ${LAYERS[layer]}${blocksOf(set)}. Grey: no surface${GREY[layer] ?? ""}.${noiseOf(set)}`,
  flip: (set) => `HDR-ꟻLIP: how much a viewer sees who flips between each picture and the reference, at any exposure${blocksOf(set)}.`,
  difference: (_, layer) => `Left darker (blue) and brighter (red) than right, in luminance, as a share of the right's mean ${LAYERS[layer]}.`,
  relative: () => "Left darker (blue) and brighter (red) than right, in luminance, as a share of the right at each pixel.",
};
const blocksOf = (set) => (set.block > 1 ? `, means of ${set.block}×${set.block} pixels` : "");

function drawScale() {
  const [kind, layer] = partsOf(state.layer);
  byId("tone").hidden = kind !== "shown";
  byId("scale").hidden = kind === "shown";
  if (kind === "shown") return;
  const isSigned = kind !== "flip";
  const context = byId("scale-bar").getContext("2d");
  for (let x = 0; x < 256; x += 1) {
    context.fillStyle = `rgb(${colourOf(isSigned ? (2 * x) / 255 - 1 : x / 255, isSigned).map(Math.round).join(" ")})`;
    context.fillRect(x, 0, 1, 1);
  }
  const tick = (share) => (isSigned ? `${share > 0 ? "+" : ""}${percent(share * scaleOf(state.layer))}` : figures(share * scaleOf(state.layer), 2));
  byId("scale-ticks").replaceChildren(...(isSigned ? [-1, -0.5, 0, 0.5, 1] : [0, 0.5, 1]).map((share) => make("span", {}, tick(share))));
  byId("scale-text").textContent = SCALE_TEXTS[kind](setOf[kind]?.(layer), layer);
}

/** Brighter, or more sensitive to errors, by steps. */
function brighten(by) {
  if (partsOf(state.layer)[0] === "shown") tone.stops = Math.min(Math.max(tone.stops + 0.5 * by, -MOST_STOPS), MOST_STOPS);
  else stepScale(state.layer, -by);
  change({});
}

function showTone() {
  byId("exposure").value = tone.stops;
  const set = setOf.shown(partsOf(state.layer)[1]);
  const stops = set.exposure + tone.stops;
  byId("stops").value = `${stops >= 0 ? "+" : "−"}${Math.abs(stops).toFixed(2)} stops`;
  byId("curve").value = tone.curve;
  byId("gamma").value = String(tone.gamma ?? "");
}

// What moves the stage

function change(changes) {
  Object.assign(state, changes);
  byId("left").value = state.left;
  byId("right").value = state.right;
  byId("layer").value = state.layer;
  checkIn(byId("view"), state.view);
  byId("records").value = state.records;
  showTone();
  drawScale();
  drawRecordLegend();
  layOut();
  markShown();
  drawCourse();
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
  p: pinUnderPointer,
  t: play,
  n: () => goToFrame(frameWanted + 1),
  b: () => goToFrame(frameWanted - 1),
  r: nextRecords,
  ".": () => brighten(1),
  ",": () => brighten(-1),
  l: () => moveTo(state.x + panes().width / 8 / scaleNow(), state.y),
  k: () => moveTo(state.x, state.y - panes().height / 8 / scaleNow()),
  j: () => moveTo(state.x, state.y + panes().height / 8 / scaleNow()),
  "?": () => { byId("keys").open = !byId("keys").open; },
};

const SLIDES = { ArrowLeft: -1, ArrowRight: 1 };

function key(event) {
  if (event.ctrlKey || event.metaKey || event.altKey || event.target.closest("select, input[type=range]")) return;
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

const OPTIONS = {
  shown: (layer) => (layer === "picture" ? "Pictures" : headingOf(layer)),
  error: (layer) => `Error of the ${LAYERS[layer]}`,
  flip: (layer) => `ꟻLIP of the ${LAYERS[layer]}`,
  difference: (layer) => `Left − right, ${LAYERS[layer]}`,
  relative: (layer) => `(Left − right) / right, ${LAYERS[layer]}`,
};

function layerOptions() {
  const because = sweep.reference ? "the reference and a pipeline must both hold it" : "no reference was given";
  const lacking = gallery.shown.map(({ layer }) => `error ${layer}`).filter((choice) => !CHOICES.includes(choice));
  const label = (choice) => OPTIONS[partsOf(choice)[0]](partsOf(choice)[1]);
  return [...CHOICES.map((choice) => [choice, label(choice)]), ...lacking.map((choice) => [choice, `${label(choice)}: ${because}`, true])];
}

function setUpStage() {
  const sides = variants.map((_, index) => [index, titleOf(index)]);
  if (imageOf("shown picture", REFERENCE)) sides.push([REFERENCE, titleOf(REFERENCE)]);
  fillSelect(byId("left"), sides, state.left, (value) => change({ left: Number(value), flipped: false }));
  fillSelect(byId("right"), sides, state.right, (value) => change({ right: Number(value), flipped: true }));
  fillSelect(byId("layer"), layerOptions(), state.layer, (layer) => change({ layer }));
  choice(byId("view"), VIEWS, state.view, (view) => change({ view }));
  setUpRecords();
  setUpFrames();
  fillSelect(byId("curve"), CURVES, tone.curve, (curve) => { tone.curve = curve; change({}); });
  fillSelect(byId("gamma"), GAMMAS, "", (gamma) => { tone.gamma = Number(gamma) || null; change({}); });
  byId("exposure").addEventListener("input", () => { tone.stops = Number(byId("exposure").value); change({}); });
  const buttons = { swap, fit: fitAll, pixels: onePixel, "zoom-in": KEYS["+"], "zoom-out": KEYS["-"], finer: () => brighten(1), coarser: () => brighten(-1), pin: pinMiddle };
  for (const [id, action] of Object.entries(buttons)) byId(id).addEventListener("click", action);
  const listeners = { pointerdown: pressed, pointermove: moved, pointerup: released, pointercancel: released, pointerleave: () => { state.hover = null; showReadout(); } };
  for (const [name, listener] of Object.entries(listeners)) stage.addEventListener(name, listener);
  stage.addEventListener("wheel", wheel, { passive: false });
  stage.addEventListener("dblclick", (event) => (state.scale === null ? zoomTo(4 / (window.devicePixelRatio || 1), under(event)) : fitAll()));
  document.addEventListener("keydown", key);
  const images = frames.flatMap(({ shown }) => shown).flatMap((set) => [...set.images, set.reference]).filter((image) => image);
  const block = Math.max(1, ...images.map((image) => image.block));
  const bits = Math.min(...images.map((image) => image.bits));
  const kept = block > 1 ? ` They are means of ${block}×${block} pixels: so many whole ones are too heavy for a page.` : "";
  const fewer = bits < 10 ? " More pictures leave each number fewer digits." : "";
  byId("lossless").textContent = images.length ? `Pictures hold linear light, right to ${percent(2 ** -(bits + 1))}.${fewer}${kept} All of a layer are shown alike. The address of this page holds the view: copy it to show another what you see.` : "";
}

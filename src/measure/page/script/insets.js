// Insets: the same small part of every picture, side by side

/** Of a pinned part [pixels of the picture]. */
const PIN_SIDE = Math.max(Math.round(Math.min(WIDTH, HEIGHT) / 8), 4);
/** Of its drawing [pixels of the page]. */
const INSET_SIDE = 128;
/** With more pictures, those on the left and on the right and the reference are shown. */
const MOST_INSETS = 12;
const MOST_PINS = 8;

function pinAt(x, y) {
  const inside = (place, side) => Math.min(Math.max(Math.round(place - PIN_SIDE / 2), 0), Math.max(side - PIN_SIDE, 0));
  change({ pins: [...state.pins, { x: inside(x, WIDTH), y: inside(y, HEIGHT) }].slice(-MOST_PINS) });
}

const pinMiddle = () => pinAt(state.x, state.y);
const pinUnderPointer = () => pinAt(state.hover?.x ?? state.x, state.hover?.y ?? state.y);
const unpin = (pin) => change({ pins: state.pins.filter((other) => other !== pin) });

function insetsOf() {
  if (isDifference(state.layer)) return [state.left];
  const all = [...byId("right").options].map((option) => Number(option.value));
  const few = all.length > MOST_INSETS ? [...new Set([state.left, state.right, REFERENCE])].filter((index) => all.includes(index)) : all;
  return few.filter((index) => imageOf(state.layer, index));
}

let insetsDrawn = "";

function drawInsets() {
  // Without insets nothing need be unpacked for them.
  const indices = state.pins.length > 0 ? insetsOf() : [];
  const sources = indices.map((index) => bitmap(state.layer, index));
  const drawn = JSON.stringify([state.layer, state.pins, indices, state.left, state.right, sources.map((source) => source?.look)]);
  if (drawn === insetsDrawn) return;
  insetsDrawn = drawn;
  byId("insets").replaceChildren(...state.pins.map((pin) => insetRow(pin, indices)));
}

function insetRow(pin, indices) {
  const place = `x ${pin.x} to ${pin.x + PIN_SIDE - 1}, y ${pin.y} to ${pin.y + PIN_SIDE - 1}`;
  const crops = indices.map((index) => make("figure", {}, cropped(pin, index), make("figcaption", {}, nameOfInset(index))));
  const save = make("button", { type: "button", class: "save", onclick: () => saveInsets(pin, indices) }, "Save PNG");
  const remove = make("button", { type: "button", class: "remove", onclick: () => unpin(pin), "aria-label": `Remove the inset at ${place}` }, "Remove");
  return make("li", {}, make("p", {}, place, save, remove), make("div", { class: "crops" }, ...crops));
}

const nameOfInset = (index) => (isDifference(state.layer) ? `${letterOf(state.left)} − ${letterOf(state.right)}` : letterOf(index));

/** Its pixels as squares. */
function cropped(pin, index) {
  const ratio = window.devicePixelRatio || 1;
  const side = Math.round(INSET_SIDE * ratio);
  const canvas = make("canvas", { width: side, height: side, "aria-hidden": "true" });
  const source = bitmap(state.layer, index);
  if (!source) return canvas;
  const context = canvas.getContext("2d");
  context.imageSmoothingEnabled = false;
  const part = PIN_SIDE / source.block;
  context.drawImage(source, pin.x / source.block, pin.y / source.block, part, part, 0, 0, side, side);
  return canvas;
}

/** The row as one picture, each with its letter. */
function saveInsets(pin, indices) {
  const ratio = window.devicePixelRatio || 1;
  const [side, gap, line] = [INSET_SIDE, 6, 20].map((length) => Math.round(length * ratio));
  const canvas = make("canvas", { width: indices.length * (side + gap) - gap, height: side + line });
  const context = canvas.getContext("2d");
  context.fillStyle = "#fff";
  context.fillRect(0, 0, canvas.width, canvas.height);
  Object.assign(context, { fillStyle: "#000", font: `${Math.round(13 * ratio)}px sans-serif`, textAlign: "center", textBaseline: "middle" });
  indices.forEach((index, place) => {
    context.drawImage(cropped(pin, index), place * (side + gap), 0);
    context.fillText(nameOfInset(index), place * (side + gap) + side / 2, side + line / 2);
  });
  saveCanvas(canvas, `${fileName("inset")}-${pin.x}-${pin.y}.png`);
}

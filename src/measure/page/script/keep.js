// What outlasts the page: a link that holds the view, and files

let linkDue = null;

/** Writes the view into the page's address, a moment after it last changed. */
function keepLink() {
  clearTimeout(linkDue);
  linkDue = setTimeout(() => {
    const place = state.scale === null ? {} : { x: state.x.toFixed(1), y: state.y.toFixed(1), zoom: state.scale.toFixed(4) };
    const light = { stops: tone.stops || null, curve: tone.curve === "soft" ? null : tone.curve, gamma: tone.gamma, scale: scales.get(state.layer) };
    const pins = state.pins.map((pin) => `${pin.x}.${pin.y}`).join("_") || null;
    const frame = frames.length > 1 ? frames[frameShown].moment.frame : null;
    const view = { frame, left: letterOf(state.left), right: letterOf(state.right), show: state.layer.replace(" ", "."), view: state.view, split: state.split.toFixed(3), ...place, ...light, records: state.records.replace(" ", ".") || null, pins };
    const parts = Object.entries(view).filter(([, value]) => value !== null && value !== undefined).map(([name, value]) => `${name}=${encodeURIComponent(value)}`);
    history.replaceState(null, "", `#${parts.join("&")}`);
  }, 150);
}

/** The view that the address holds; what it does not name, or names wrongly, stays as it is. */
function readLink() {
  const view = new URLSearchParams(location.hash.slice(1));
  const number = (name, least, most) => (view.get(name) && Number(view.get(name)) >= least && Number(view.get(name)) <= most ? Number(view.get(name)) : null);
  const side = (name) => {
    const index = view.get(name) === "reference" && imageOf("shown picture", REFERENCE) ? REFERENCE : variants.findIndex((variant) => variant.id === view.get(name));
    return index < 0 ? null : index;
  };
  const shown = view.get("show")?.replace(".", " ");
  tone.stops = number("stops", -MOST_STOPS, MOST_STOPS) ?? tone.stops;
  tone.curve = CURVES.some(([name]) => name === view.get("curve")) ? view.get("curve") : tone.curve;
  tone.gamma = number("gamma", 0.1, 10) ?? tone.gamma;
  const pins = (view.get("pins") ?? "").split("_").map((pin) => pin.split(".").map(Number));
  const records = view.get("records")?.replace(".", " ");
  const wanted = {
    left: side("left"),
    right: side("right"),
    layer: CHOICES.includes(shown) ? shown : null,
    view: VIEWS.some(([name]) => name === view.get("view")) ? view.get("view") : null,
    split: number("split", 0, 1),
    records: RECORD_CHOICES.includes(records) ? records : null,
    scale: number("zoom", 1e-3, MOST_SCALE),
    x: number("x", 0, WIDTH),
    y: number("y", 0, HEIGHT),
    pins: view.has("pins") ? pins.filter(([x, y]) => x >= 0 && y >= 0 && x + PIN_SIDE <= WIDTH && y + PIN_SIDE <= HEIGHT).slice(0, MOST_PINS).map(([x, y]) => ({ x, y })) : null,
  };
  const frame = frames.findIndex(({ moment }) => moment && moment.frame === number("frame", 0, Infinity));
  if (frame >= 0) goToFrame(frame);
  const scale = number("scale", 1e-5, 1000);
  if (scale && wanted.layer) scales.set(wanted.layer, scale);
  return Object.fromEntries(Object.entries(wanted).filter(([, value]) => value !== null));
}

// Files

const frameName = () => (frames.length > 1 ? `-${String(frames[frameShown].moment.frame).padStart(4, "0")}` : "");
const fileName = (what) => `${report.title.split(":")[0].replace(/[^\p{L}\p{N}]+/gu, "-").slice(0, 60)}-${what}-${state.layer.replace(" ", "-")}${frameName()}`;

function saveBlob(blob, name) {
  const address = URL.createObjectURL(blob);
  make("a", { href: address, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(address), 1000);
}

const saveCanvas = (canvas, name) => canvas.toBlob((blob) => saveBlob(blob, name), "image/png");

/** A picture or map as it is shown, or its numbers. */
function saveSide(index) {
  const canvas = bitmap(state.layer, index);
  if (!canvas) return;
  const what = isDifference(state.layer) ? `${letterOf(state.left)}-less-${letterOf(state.right)}` : letterOf(index);
  if (byId("save-as").value === "png") saveCanvas(withRecords(canvas, index), `${fileName(what)}.png`);
  else saveBlob(new Blob([exrOf(isDifference(state.layer) ? differenceOf(state.layer) : planesOf(state.layer, index))]), `${fileName(what)}.exr`);
}

/** A picture and the records that are shown over it. */
function withRecords(source, index) {
  const canvas = make("canvas", { width: source.width, height: source.height });
  const context = canvas.getContext("2d");
  context.drawImage(source, 0, 0);
  drawRecords(context, index, [0, 0], 1 / source.block, [0, 0, source.width, source.height]);
  return canvas;
}

/** An OpenEXR file of 32-bit numbers without compression; what has no number is 0. */
function exrOf(source) {
  const { width, height } = source;
  const names = source.errors || source.planes.length === 1 ? ["Y"] : ["B", "G", "R"];
  const value = { Y: (at) => (source.errors ? source.errors[at] : valueIn(source, 0, at)), R: (at) => valueIn(source, 0, at), G: (at) => valueIn(source, 1, at), B: (at) => valueIn(source, 2, at) };
  const parts = [];
  const text = (letters) => parts.push(...[...letters].map((letter) => letter.charCodeAt(0)), 0);
  const whole = (...numbers) => numbers.forEach((number) => parts.push(...new Uint8Array(new Int32Array([number]).buffer)));
  const real = (...numbers) => numbers.forEach((number) => parts.push(...new Uint8Array(new Float32Array([number]).buffer)));
  const attribute = (name, kind, size) => { text(name); text(kind); whole(size); };
  whole(20000630, 2);
  attribute("channels", "chlist", 18 * names.length + 1);
  names.forEach((name) => { text(name); whole(2, 0, 1, 1); });
  parts.push(0);
  attribute("compression", "compression", 1);
  parts.push(0);
  for (const name of ["dataWindow", "displayWindow"]) { attribute(name, "box2i", 16); whole(0, 0, width - 1, height - 1); }
  attribute("lineOrder", "lineOrder", 1);
  parts.push(0);
  attribute("pixelAspectRatio", "float", 4);
  real(1);
  attribute("screenWindowCenter", "v2f", 8);
  real(0, 0);
  attribute("screenWindowWidth", "float", 4);
  real(1);
  parts.push(0);
  const [head, line] = [parts.length, 8 + 4 * width * names.length];
  const file = new DataView(new ArrayBuffer(head + height * (8 + line)));
  parts.forEach((byte, at) => file.setUint8(at, byte));
  for (let y = 0; y < height; y += 1) {
    let at = head + 8 * height + y * line;
    file.setUint32(head + 8 * y, at, true);
    file.setInt32(at, y, true);
    file.setInt32(at + 4, line - 8, true);
    at += 8;
    for (const name of names) for (let x = 0; x < width; x += 1, at += 4) file.setFloat32(at, value[name](y * width + x) || 0, true);
  }
  return file.buffer;
}

// Pictures: light as the page keeps it, unpacked when it is first shown, and what a screen shows of it

/** What the stage can show of a layer. `shown`: its light; `error`: how far each is from the reference; `flip`: as a viewer sees that; `difference`: left less right. */
const setOf = {
  shown: (layer, { shown } = gallery) => shown.find((set) => set.layer === layer),
  error: (layer, { maps } = gallery) => maps.find((set) => set.layer === layer),
  flip: (_, { flip } = gallery) => flip,
};
const partsOf = (choice) => choice.split(" ");

function imageOf(choice, index, frame = frameShown) {
  const [kind, layer] = partsOf(choice);
  const set = setOf[kind]?.(layer, frames[frame]);
  return index === REFERENCE ? set?.reference : set?.images[index];
}

const unpacked = new Map();

/** The planes of a picture or map: undefined while they are unpacked, null where there are none. */
function planesOf(choice, index, frame = frameShown) {
  const key = `${frame} ${choice} ${index}`;
  if (!unpacked.has(key)) {
    const image = imageOf(choice, index, frame);
    unpacked.set(key, image ? undefined : null);
    if (image) unpack(choice, index, frame).then((planes) => { unpacked.set(key, planes); if (!showWanted()) draw(); });
  }
  return unpacked.get(key);
}

const firsts = new Map();

/** The integers of the first variant's picture, from which others are told. */
function firstOf(choice, frame) {
  const key = `${frame} ${choice}`;
  if (!firsts.has(key)) firsts.set(key, integersIn(choice, 0, frame));
  return firsts.get(key);
}

/** A frame's first picture may be told from the first frame's, each of its others from its first. */
async function integersIn(choice, index, frame) {
  const image = imageOf(choice, index, frame);
  const integers = await integersOf(image);
  if (image.from_first) addTo(integers, await firstOf(choice, index === 0 ? 0 : frame));
  return integers;
}

async function unpack(choice, index, frame) {
  const image = imageOf(choice, index, frame);
  const integers = await integersIn(choice, index, frame);
  const exposure = setOf.shown(partsOf(choice)[1])?.exposure ?? 0;
  const values = valuesByInteger(image.bits, partsOf(choice)[0] === "shown" ? exposure : 0);
  const [green, red, blue] = integers;
  if (integers.length === 3) for (const plane of [red, blue]) addTo([plane], [green]);
  return { ...image, source: null, planes: integers.length === 3 ? [red, green, blue] : integers, values };
}

/** The integers of each plane: what the bytes tell, and where they are no differences from another picture, what the neighbours foretell. */
async function integersOf({ source, width, height, channels, from_first }) {
  const bytes = await inflate(source);
  const pixels = width * height;
  return Array.from({ length: channels }, (_, channel) => {
    const plane = new Int16Array(pixels);
    const low = 2 * channel * pixels;
    for (let at = 0; at < pixels; at += 1) {
      const number = bytes[low + at] | (bytes[low + pixels + at] << 8);
      plane[at] = (number >> 1) ^ -(number & 1);
    }
    if (!from_first) addForetold(plane, width);
    return plane;
  });
}

async function inflate(text) {
  const letters = atob(text);
  const bytes = new Uint8Array(letters.length);
  for (let at = 0; at < letters.length; at += 1) bytes[at] = letters.charCodeAt(at);
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

function addForetold(plane, width) {
  for (let at = 0; at < plane.length; at += 1) {
    const hasLeft = at % width > 0;
    const hasAbove = at >= width;
    const left = hasLeft ? plane[at - 1] : 0;
    const above = hasAbove ? plane[at - width] : 0;
    const between = hasLeft && hasAbove ? plane[at - width - 1] : 0;
    const told = left + above - between;
    plane[at] += Math.min(Math.max(told, Math.min(left, above)), Math.max(left, above));
  }
}

function addTo(planes, others) {
  planes.forEach((plane, index) => { for (let at = 0; at < plane.length; at += 1) plane[at] += others[index][at]; });
}

const tables = new Map();

/** The value of each integer, by its 16 bits: a half float without the bits that were dropped, over 2^exposure. */
function valuesByInteger(bits, exposure) {
  const key = `${bits} ${exposure}`;
  if (!tables.has(key)) {
    const table = new Float32Array(65536);
    const scale = 2 ** -exposure;
    for (let at = -32768; at < 32768; at += 1) table[at & 65535] = at === -32768 ? NaN : Math.sign(at) * half(Math.abs(at) << (10 - bits)) * scale;
    tables.set(key, table);
  }
  return tables.get(key);
}

const half = (bits) => ((bits >> 10) === 0 ? (bits & 1023) * 2 ** -24 : (1 + (bits & 1023) / 1024) * 2 ** ((bits >> 10) - 15));
const valueIn = (source, channel, at) => source.values[source.planes[channel][at] & 65535];
const luminance = (source, at) => 0.2126 * valueIn(source, 0, at) + 0.7152 * valueIn(source, 1, at) + 0.0722 * valueIn(source, 2, at);

// Light to colours

/** As the program's own pictures: bright light runs gently into white; or cut off there. */
const CURVES = [["soft", "Soft"], ["clipped", "Clipped at 1"]];
const tone = { stops: 0, gamma: null, curve: "soft" };

/** The screen's byte of light of 0 to 1, in 4096 steps: sRGB, or a power. */
function bytesOf(gamma) {
  const encode = gamma ? (light) => light ** (1 / gamma) : (light) => (light <= 0.0031308 ? 12.92 * light : 1.055 * light ** (1 / 2.4) - 0.055);
  return Uint8Array.from({ length: 4097 }, (_, at) => Math.round(255 * encode(at / 4096)));
}

function paintLight(pixels, source, set) {
  const scale = 2 ** (set.exposure + tone.stops);
  const table = source.values.map((value) => Math.max(value * scale, 0));
  const bytes = bytesOf(tone.gamma);
  const [red, green, blue] = source.planes;
  const isSoft = tone.curve === "soft";
  for (let at = 0; at < red.length; at += 1) {
    const r = table[red[at] & 65535];
    const g = table[green[at] & 65535];
    const b = table[blue[at] & 65535];
    const most = r > g ? (r > b ? r : b) : g > b ? g : b;
    const factor = 4096 * (isSoft && most > 0 ? -Math.expm1(-most) / most : 1);
    pixels[4 * at] = bytes[Math.min(r * factor + 0.5, 4096) | 0];
    pixels[4 * at + 1] = bytes[Math.min(g * factor + 0.5, 4096) | 0];
    pixels[4 * at + 2] = bytes[Math.min(b * factor + 0.5, 4096) | 0];
    pixels[4 * at + 3] = 255;
  }
}

/** Blue is too dark, red too bright, the middle right; the farther the brighter. */
const DIVERGING = [[150, 214, 255], [58, 138, 220], [30, 60, 120], [22, 25, 29], [122, 34, 30], [222, 92, 52], [255, 214, 140]];
/** From nothing to all. */
const RISING = [[22, 25, 29], [66, 32, 92], [150, 44, 94], [226, 92, 62], [250, 176, 80], [255, 246, 190]];
const NOTHING = [70, 74, 79, 255];

function between(colours, share) {
  const place = share * (colours.length - 1);
  const below = Math.min(Math.floor(place), colours.length - 2);
  return colours[below].map((channel, index) => channel + (colours[below + 1][index] - channel) * (place - below));
}

/** The colour of an error, as a share of the scale: -1 to 1, or 0 to 1 where none is negative. */
const colourOf = (error, isSigned) => (isSigned ? between(DIVERGING, (error + 1) / 2) : between(RISING, error));

function paintErrors(pixels, errors, scale, isSigned) {
  const palette = Array.from({ length: 511 }, (_, at) => colourOf(isSigned ? at / 255 - 1 : at / 510, isSigned).map(Math.round).concat(255));
  const [offset, factor] = isSigned ? [255, 255 / scale] : [0, 510 / scale];
  for (let at = 0; at < errors.length; at += 1) {
    const error = errors[at];
    pixels.set(Number.isNaN(error) ? NOTHING : palette[Math.min(Math.max(Math.round(offset + error * factor), 0), 510)], 4 * at);
  }
}

// What is drawn: a canvas for each picture or map, painted anew where exposure or scale changed

const canvases = new Map();

/** Undefined while it is unpacked, null where there is none. */
function bitmap(choice, index) {
  if (isDifference(choice)) return painted(choice, differenceOf(choice), choice, `${state.left} ${state.right}`);
  return painted(`${choice} ${index}`, planesOf(choice, index), choice, "");
}

function painted(key, source, choice, of) {
  if (!source) return source;
  const [kind, layer] = partsOf(choice);
  const look = `${frameShown} ${of} ${kind === "shown" ? `${tone.stops} ${tone.gamma} ${tone.curve}` : scaleOf(choice)}`;
  const known = canvases.get(key);
  if (known?.look === look) return known;
  const canvas = known ?? make("canvas");
  Object.assign(canvas, { width: source.width, height: source.height, block: source.block });
  const context = canvas.getContext("2d", { willReadFrequently: true });
  const pixels = context.createImageData(source.width, source.height);
  if (kind === "shown") paintLight(pixels.data, source, setOf.shown(layer));
  else paintErrors(pixels.data, source.errors ?? Float32Array.from(source.planes[0], (integer) => source.values[integer & 65535]), scaleOf(choice), kind !== "flip");
  context.putImageData(pixels, 0, 0);
  canvases.set(key, canvas);
  canvas.look = look;
  return canvas;
}

// Differences of what is on the left and on the right

const isDifference = (choice) => choice.startsWith("difference ") || choice.startsWith("relative ");
const subtracted = new Map();

/** How much brighter the left is than the right, over the right's mean or at each pixel over the right. Undefined while pictures are unpacked, null where one lacks. */
function differenceOf(choice, left = state.left, right = state.right) {
  const [kind, layer] = partsOf(choice);
  const sources = [left, right].map((index) => planesOf(`shown ${layer}`, index));
  if (sources.includes(null)) return null;
  if (sources.includes(undefined)) return undefined;
  const key = `${frameShown} ${choice} ${left} ${right}`;
  if (!subtracted.has(key)) {
    // One at a time: each is as large as a picture.
    subtracted.clear();
    subtracted.set(key, { ...sources[0], ...subtract(sources, kind === "relative") });
  }
  return subtracted.get(key);
}

function subtract([left, right], isRelative) {
  if (left.width !== right.width || left.height !== right.height) return { errors: new Float32Array(left.width * left.height).fill(NaN) };
  const errors = new Float32Array(left.width * left.height);
  let sum = 0;
  for (let at = 0; at < errors.length; at += 1) sum += luminance(right, at);
  const mean = sum / errors.length;
  for (let at = 0; at < errors.length; at += 1) {
    const [mine, other] = [luminance(left, at), luminance(right, at)];
    const over = isRelative ? other : mean;
    errors[at] = mine === other ? 0 : over > 0 ? (mine - other) / over : NaN;
  }
  return { errors };
}

/** The error of a map's last colour: of the pictures' maps as the program found it, of differences a tenth, until the reader changes it. */
const scales = new Map();

function scaleOf(choice) {
  if (scales.has(choice)) return scales.get(choice);
  const [kind, layer] = partsOf(choice);
  return setOf[kind]?.(layer)?.scale ?? 0.1;
}

/** To the next of 1, 2 and 5 times a power of ten. */
function stepScale(choice, by) {
  const steps = [1, 2, 5];
  const now = scaleOf(choice);
  const power = Math.floor(Math.log10(now) + 1e-9);
  const place = 3 * power + steps.findIndex((step) => now <= step * 10 ** power * 1.001) + by;
  const next = Math.min(Math.max(place, -15), 6);
  scales.set(choice, Number((steps[((next % 3) + 3) % 3] * 10 ** Math.floor(next / 3)).toPrecision(1)));
}

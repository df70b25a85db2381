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

/** Pictures of a layer go by its name behind `shown`, maps of its errors by its name alone. */
const shownSet = (layer) => gallery.shown.find((set) => `shown ${set.layer}` === layer);
const mapSet = (layer) => gallery.maps.find((set) => set.layer === layer);

function imageOf(layer, index) {
  const set = shownSet(layer) ?? mapSet(layer);
  return index === REFERENCE ? set?.reference : set?.images[index];
}

async function decode(layer, image) {
  const canvas = await load(image);
  if (!shownSet(layer)) return colour(canvas, mapSet(layer));
  return image.from_first ? addTo(canvas, await load(shownSet(layer).images[0])) : canvas;
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

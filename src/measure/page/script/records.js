// Records over the pictures: rings as far as each reaches, coloured by what ended its reach or by how sure it is

/** What rings tell. */
const TELLS = { limit: "what limits them", error: "how sure they are" };
/** By what ended a record's reach: the parameters of RecordCache. */
const LIMITS = { accuracy: "#56b4e9", nearest: "#e69f00", change: "#cc79a7", minimum_spacing: "#f0e442", maximum_spacing: "#009e73" };
/** Standard errors up to each [share of the irradiance]; the last colour is of all above. */
const SURENESS = [[0.01, "#a58cff"], [0.02, "#4686fb"], [0.05, "#1bd0d5"], [0.1, "#a4fc3c"], [0.2, "#fb8022"], [Infinity, "#d11807"]];
const CACHES = [...new Set(gallery.records.flat().map(({ cache }) => cache))];
/** None, then every way to show the records of each cache. */
const RECORD_CHOICES = ["", ...CACHES.flatMap((cache) => Object.keys(TELLS).map((tells) => `${tells} ${cache}`))];
/** Rings of more records than this at once are drawn without their centres. */
const MOST_CENTRES = 4000;

const recordsOf = (index) => frames[frameShown].records[index]?.find(({ cache }) => cache === partsOf(state.records)[1]);

const recordsUnpacked = new Map();

/** The records of a variant: undefined while they are unpacked, null where there are none. */
function unpackedRecords(index) {
  const set = recordsOf(index);
  if (!set) return null;
  if (!recordsUnpacked.has(set)) {
    recordsUnpacked.set(set, undefined);
    inflate(set.source).then((bytes) => { recordsUnpacked.set(set, columnsOf(set, bytes)); draw(); });
  }
  return recordsUnpacked.get(set);
}

/** Columns of numbers, as the page keeps them. */
function columnsOf(set, bytes) {
  const length = bytes.length / 19;
  const integers = new Uint16Array(bytes.buffer.slice(0, 18 * length));
  const column = (place, value) => Float32Array.from(integers.subarray(place * length, (place + 1) * length), value);
  const short = (bits) => ((bits & 32768) ? -half(bits & 32767) : half(bits));
  const word = new DataView(new ArrayBuffer(4));
  const upper = (bits) => { word.setUint32(0, bits << 16); return word.getFloat32(0); };
  const [x, y] = [WIDTH, HEIGHT].map((side, place) => column(place, (share) => (share / 65535) * side));
  const [ax, ay, bx, by] = [2, 3, 4, 5].map((place) => column(place, short));
  const [reach, irradiance, error] = [6, 7, 8].map((place) => column(place, upper));
  return { length, x, y, ax, ay, bx, by, reach, irradiance, error, limit: bytes.subarray(18 * length), limits: set.limits };
}

/** The colour of each record's ring. */
function colourOfRing(records, at) {
  if (partsOf(state.records)[0] === "limit") return LIMITS[records.limits[records.limit[at]]];
  return SURENESS.find(([most]) => records.error[at] <= most)[1];
}

/** Draws into a context whose picture begins at `corner`, `scale` of its pixels a pixel of the picture; `view` is what can be seen: left, top, right, bottom. */
function drawRecords(context, index, corner, scale, view) {
  const records = state.records ? unpackedRecords(index) : null;
  if (!records) return;
  const byColour = new Map();
  for (let at = 0; at < records.length; at += 1) {
    const [x, y] = [corner[0] + records.x[at] * scale, corner[1] + records.y[at] * scale];
    const [width, height] = [Math.hypot(records.ax[at], records.bx[at]) * scale, Math.hypot(records.ay[at], records.by[at]) * scale];
    if (x + width < view[0] || y + height < view[1] || x - width > view[2] || y - height > view[3]) continue;
    const colour = colourOfRing(records, at);
    if (!byColour.has(colour)) byColour.set(colour, []);
    byColour.get(colour).push([at, x, y]);
  }
  const seen = [...byColour.values()].reduce((sum, places) => sum + places.length, 0);
  for (const [colour, places] of byColour) drawRings(context, records, places, scale, colour, seen <= MOST_CENTRES);
}

function drawRings(context, records, places, scale, colour, withCentres) {
  const whole = context.getTransform();
  context.beginPath();
  for (const [at, x, y] of places) {
    context.setTransform(whole.multiply(new DOMMatrix([records.ax[at] * scale, records.ay[at] * scale, records.bx[at] * scale, records.by[at] * scale, x, y])));
    context.moveTo(1, 0);
    context.arc(0, 0, 1, 0, 2 * Math.PI);
  }
  context.setTransform(whole);
  Object.assign(context, { strokeStyle: colour, fillStyle: colour, lineWidth: 1 });
  context.stroke();
  if (withCentres) for (const [, x, y] of places) context.fillRect(x - 1, y - 1, 2, 2);
}

/** The record whose centre is nearest to a pixel, in words; nothing where none is near. */
function recordAt(index, x, y) {
  const records = state.records ? unpackedRecords(index) : null;
  if (!records) return [];
  let [found, least] = [null, 8 / scaleNow()];
  for (let at = 0; at < records.length; at += 1) {
    const distance = Math.hypot(records.x[at] - x - 0.5, records.y[at] - y - 0.5);
    if (distance < least) [found, least] = [at, distance];
  }
  if (found === null) return [];
  const limit = records.limits[records.limit[found]];
  return [`record of ${letterOf(index)}: ${exactly(records.irradiance[found])} W/m² ± ${percent(records.error[found])}, reaches ${figures(records.reach[found])}, limited by ${limit}`];
}

function drawRecordLegend() {
  const [tells, cache] = partsOf(state.records);
  byId("rings").hidden = !tells;
  if (!tells) return;
  const swatch = ([colour, label]) => make("li", {}, make("i", { style: `background: ${colour}` }), label);
  const limits = Object.entries(LIMITS).map(([limit, colour]) => [colour, limit]);
  const surenesses = SURENESS.map(([most, colour], place) => [colour, most === Infinity ? `above ${percent(SURENESS[place - 1][0])}` : `to ${percent(most)}`]);
  byId("rings-legend").replaceChildren(...(tells === "limit" ? limits : surenesses).map(swatch));
  const meaning = tells === "limit" ? "the colour names the parameter of the cache that ends it" : "the colour is the standard error of its irradiance, as a share of it";
  const counts = [...new Set([state.left, state.right].map(countOf))].filter((count) => count);
  byId("rings-text").textContent = `Rings: how far each record of \`${cache}\` reaches; ${meaning}. ${counts.join(" ")} As they were made, before any filter.`;
}

function countOf(index) {
  const set = recordsOf(index);
  if (!set && frames[frameShown] !== gallery) return "Records are shown of the last frame alone.";
  if (!set) return index === REFERENCE ? "" : `${letterOf(index)} has no such records.`;
  const part = set.every > 1 ? `, of which one in ${set.every} is drawn` : "";
  return `${letterOf(index)}: ${set.count.toLocaleString("en")}${part}.`;
}

const nextRecords = () => change({ records: step(RECORD_CHOICES, state.records, 1) });

function setUpRecords() {
  const label = (choice) => {
    const [tells, cache] = partsOf(choice);
    if (!tells) return "none";
    return CACHES.length > 1 ? `${cache}: ${TELLS[tells]}` : TELLS[tells];
  };
  fillSelect(byId("records"), RECORD_CHOICES.map((choice) => [choice, label(choice)]), "", (records) => change({ records }));
  byId("records").parentElement.hidden = CACHES.length === 0;
}

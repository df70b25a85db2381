// The plot of error over cost

const NARROW = 600;
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
  marks.filter((mark) => mark.dataset.id).forEach(makeButton);
  byId("plot").replaceChildren(figure);
  const shown = new Set(marks.map((mark) => mark.dataset.id));
  const without = variants.map((variant) => variant.id).filter((id) => !shown.has(id));
  const left = without.length ? ` Not shown, for their error or cost is not known: ${without.join(", ")}.` : "";
  const signed = chart.errors.some((error) => error < 0) ? " Sizes of the errors, without their signs." : "";
  const cut = variants.some(({ cuts }) => cuts?.length) ? " Marks without a letter are runs that were ended early." : "";
  byId("plot-note").textContent = `Bars are quartiles of costs and 95 % intervals of errors. Ringed points lie on the Pareto front: nothing beats them by a difference that holds. Hollow ones are below the noise of the reference. A point opens its picture on the right.${cut}${signed}${left}`;
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
const secondsOf = ({ state, seconds }) => (state === "given" ? seconds : seconds?.median ?? null);
const counted = (value) => (value === null ? "–" : String(value));

/** Values of a parameter are sorted as numbers where all are. */
function axisColumn({ parameter, values }) {
  const areNumbers = values.every((value) => value.trim() !== "" && Number.isFinite(Number(value)));
  return { name: parameter, value: ({ values }) => (areNumbers ? Number(values[parameter]) : values[parameter]), text: (_, { values }) => values[parameter], words: !areNumbers };
}

/** Of a sequence: what no single frame tells. */
const COURSE_LAYERS = Object.keys(LAYERS).filter((layer) => variants.some(({ courses }) => courses?.[layer]));
const COURSE_COLUMNS = [
  ["mean error", "Root mean square over the reference's mean, mean over all frames", ({ mean }) => mean.rmse_over_mean, percent],
  ["flicker", "Change from frame to frame beyond the reference's own, over its mean", ({ flicker }) => flicker, percent],
  ["lag", "Frames after a jump of the light until 99 % of what has jumped is within 5 %", ({ lag_p99 }) => lag_p99, (frames) => figures(frames)],
  ["ghost", "99th percentile of what is wrong five frames after a jump, over the frame's mean", ({ ghost_p99 }) => ghost_p99, percent],
];

function courseColumns(layer) {
  const column = ([name, tip, value, text]) => ({ name: `${LAYERS[layer]}: ${name}`, tip, value: ({ courses }) => (courses?.[layer] ? value(courses[layer]) ?? null : null), text, least: true });
  return COURSE_COLUMNS.map(column);
}

/** Name, tooltip, value to sort by, text; `least` where a small value is the better one. A column that knows nothing is left out. */
const COLUMNS = [
  { name: "", tip: "Opens the picture", value: (_, index) => index },
  { name: "Pipeline", value: (variant) => (onlyRow === null ? variant.row : null), text: (value) => value, words: true },
  ...sweep.over.map(axisColumn),
  { name: "State", value: (variant) => (["measured", "given"].includes(variant.state) ? null : variant.because ? `refused: ${variant.because}` : variant.state), text: (value) => value ?? "measured", words: true },
  { name: "Seconds", tip: "Median of the runs; of a picture of another program as stated", value: secondsOf, text: (value) => figures(value), least: true },
  { name: "Quartiles", value: ({ seconds }) => (seconds?.median ? seconds.upper_quartile - seconds.lower_quartile : null), text: (_, { state, seconds }) => (seconds?.median ? `${figures(seconds.lower_quartile)} … ${figures(seconds.upper_quartile)}` : state === "given" && seconds ? "as stated" : "–") },
  { name: `× ${variants[0]?.id}`, tip: "Time over that of the first; in brackets where no more than noise", value: (variant, index) => (index ? pairWith(variants[0].id, variant.id)?.ratio ?? null : pairs.length ? 1 : null), text: ratioText },
  { name: sweep.cost, tip: "What errors are held against", value: (_, index) => report.costs[index] ?? null, text: (value) => figures(value), least: true },
  { name: "Front", tip: `On the Pareto front of ${sweep.metric} over ${sweep.cost}`, value: (variant) => (sweep.over.length === 0 ? null : variant.pareto ? 0 : 1), text: (value) => (value === 0 ? "●" : "") },
  { name: "Records", value: (variant) => variant.records?.irradiance ?? null, text: counted },
  { name: "Uncovered", tip: "Pixels that see a surface that no record covers", value: (variant) => variant.uncovered_pixels ?? null, text: counted },
  { name: "Device MiB", value: (variant) => (variant.peak_gpu_bytes ? variant.peak_gpu_bytes / 2 ** 20 : null), text: (value) => figures(value), least: true },
  { name: "Start-up s", tip: "Plan, shaders, first picture", value: (_, index) => beside[index].start_up_seconds, text: (value) => figures(value) },
  ...charts.map((chart) => ({ name: chart.label, tip: chart.meaning, value: (_, index) => chart.errors[index], text: (_, __, index) => chart.told[index]?.value ?? "–", interval: (index) => chart.told[index]?.interval ?? null, hidden: (index) => chart.hidden[index], least: true, sized: true })),
  ...COURSE_LAYERS.flatMap(courseColumns),
].filter((column) => variants.some((variant, index) => column.value(variant, index) !== null));

function ratioText(value, variant, index) {
  if (value === null || index === 0) return value === null ? "–" : "1";
  return pairWith(variants[0].id, variant.id)?.significant ? figures(value) : `(${figures(value)})`;
}

function errorsText(reference) {
  if (!reference) return "No reference was given: there are no errors.";
  const corrected = ["irradiance", "glossy"].filter((layer) => variants.some((variant) => variant.errors?.[layer])).map((layer) => LAYERS[layer]);
  const texts = [
    reference.row ? `Errors are differences from ${reference.row} at the same values.` : null,
    corrected.length && !reference.row ? `Errors of the ${corrected.join(" and of the ")} are corrected for the reference's noise.` : null,
    setOf.error("direct") ? "A pipeline that computes direct light alone is judged by that, without correction; what its picture is held against has all light." : null,
  ];
  return texts.filter((text) => text !== null).join(" ");
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
  // What the reference's noise hides may be less than any other: then none is known to be the best.
  if (variants.some((_, index) => column.hidden?.(index))) return null;
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
    const interval = column.interval?.(index);
    const parts = [column.text(value, variant, index), interval ? make("small", {}, interval) : null].filter((part) => part !== null);
    return make("td", { class: [column.words ? "text" : "", least ? "least" : ""].join(" ").trim() || null, title: column.words ? value : null }, ...parts);
  });
  return make("tr", { "data-variant": index }, make("td", { class: "text" }, button), ...cells);
}

// Expectations

const cameTrue = { true: "came", false: "missed", null: null };

/** What a study's file expects of its numbers, and what came of that. */
function setUpExpected() {
  const [head, ...rows] = report.expectations;
  byId("expected").closest("section").hidden = rows.length === 0;
  if (rows.length === 0) return;
  const wordsAt = new Set([0, head.length - 1]);
  const cells = (tag, attributes, texts) => texts.map((text, place) => make(tag, { ...attributes, class: wordsAt.has(place) ? "text" : null }, text));
  const row = (texts, index) => make("tr", { class: cameTrue[sweep.expected[index].as_expected] }, ...cells("td", {}, texts));
  byId("expected").tHead.replaceChildren(make("tr", {}, ...cells("th", { scope: "col" }, head)));
  byId("expected").tBodies[0].replaceChildren(...rows.map(row));
  const missed = sweep.expected.filter((found) => found.as_expected === false).length;
  byId("expected-note").textContent = `${missed ? `${missed} of ${rows.length} did not come.` : "Nothing is missed."} The verdict is on what the source says.`;
}

// Pairs

function drawPairs() {
  const of = byId("of").value;
  const shown = [...pairs, ...differences.errors].filter((pair) => of === "all" || pair.first === of || pair.second === of);
  const kindOf = (pair) => (pair.significant ? "significant" : pair.ratio_interval === null ? "open" : null);
  const items = shown.map((pair) => make("li", { class: kindOf(pair) }, pair.words));
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
  byId("bars").replaceChildren(...variants.flatMap((variant, index) => (variant.passes ? barOf(variant, index, sums[index], most, hue) : [])));
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
  if (variant.state === "given") {
    byId("text").replaceChildren();
    byId("text-note").textContent = `The picture of another program: ${variant.file}${variant.layer ? `, its layer ${variant.layer}` : ""}.`;
    return;
  }
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

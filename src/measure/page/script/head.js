// What was found, as the program wrote it. Nothing of it is ever read as HTML: it reaches the page as text alone.
const { report, gallery: { frames } } = JSON.parse(document.getElementById("data").textContent);
/** Of the last frame of a sequence, or of the only one: all have the same layers, exposures and scales. */
const gallery = frames.at(-1);
/** The place of the frame that is shown. */
let frameShown = frames.length - 1;
const { sweep, beside, charts, differences } = report;
const variants = sweep.points;
const [WIDTH, HEIGHT] = sweep.size;
const REFERENCE = variants.length;
const MOST_SCALE = 64;

/** How long a frame of the sequence lasts [s]. */
function frameSeconds() {
  const seconds = frames.length > 1 ? (gallery.moment.seconds - frames[0].moment.seconds) / (frames.length - 1) : 0;
  return seconds > 0 ? seconds : 1 / 24;
}

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
/** What all points are of, where only parameters change; their names need not say it. */
const onlyRow = sweep.over.length && variants.every(({ row }) => row === variants[0].row) ? variants[0].row : null;
const nameOf = (variant) => [...(onlyRow === null ? [variant.row] : []), ...valuesOf(variant)].join(" ");
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
    ...(onlyRow === null ? [] : [["Pipeline", onlyRow]]),
    ["Camera", sweep.camera],
    ["Size", `${WIDTH}×${HEIGHT}`],
    ...(frames.length > 1 ? [["Frames", `${frames[0].moment.frame} to ${gallery.moment.frame}, ${figures(1 / frameSeconds())} a second`]] : []),
    ["Triangles", sweep.triangles.toLocaleString("en")],
    ["Adapter", `${sweep.adapter.name} (${sweep.adapter.backend})`],
    ["Runs of each", runs],
    ["Reference", referenceText(sweep.reference)],
  ];
  byId("facts").append(...facts.map(([name, value]) => make("div", {}, make("dt", {}, name), make("dd", {}, value))));
  const old = "DecompressionStream" in window ? [] : ["This browser cannot unpack the pictures. One of 2023 or later can."];
  const warnings = [...report.warnings, ...old];
  byId("warnings").append(...warnings.map((warning) => make("li", {}, warning)));
  byId("warnings").hidden = warnings.length === 0;
}

function referenceText(reference) {
  if (!reference) return "none";
  if (reference.row) return `${reference.row}, at the same values`;
  return reference.samples ? `${reference.samples} rays a pixel` : "given";
}

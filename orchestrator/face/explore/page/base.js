"use strict";
// What all parts of the page share: its state, elements that are made from text alone, and questions to the server.
const PAGE_ID = [...crypto.getRandomValues(new Uint8Array(9))].map(x => x.toString(36)).join("");
const SAVED = document.getElementById("saved") ? JSON.parse(document.getElementById("saved").textContent) : null;
// Of several scenarios in a saved page each has sliders' values, the case's own and a first screen.
if (SAVED?.others) {
  for (const key of ["grid", "own", "first"]) {
    const ofTheFirst = SAVED[key];
    Object.defineProperty(SAVED, key, { get: () => SAVED.others[state.scenario]?.[key] ?? ofTheFirst });
  }
}
const COLOURS = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#8c6d31", "#7f7f7f"];
// A colour as it is seen well on the window's paper: paler in a dark one.
const seenWell = colour => `color-mix(in srgb, ${colour} var(--pure), white)`;
const SVG = "http://www.w3.org/2000/svg";

// What the address holds; everything else follows from it.
const state = { scenario: "", values: {}, range: [0.1, 2], controls: [], mode: null, pin: null, tab: "", signals: "", events: null, places: {} };
const theCase = () => ({ scenario: state.scenario, values: state.values, events: state.events, places: state.places, step: seen.beginning?.step ?? null });
// What was answered to it.
const seen = { titles: {}, answer: null, modes: [], info: null, pinned: null, estimate: null, slopes: {}, trails: [], movers: null, firstCurves: null, curves: {}, pinnedCurves: {}, stamp: null, timing: {}, finders: {}, cancels: 0 };

const $ = id => document.getElementById(id);
const same = (a, b) => JSON.stringify(a) === JSON.stringify(b);
const copyOf = x => JSON.parse(JSON.stringify(x));

function make(name, attributes = {}, ...children) {
  const element = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) if (value !== null && value !== undefined) element.setAttribute(key, value);
  element.append(...children.filter(child => child !== null));
  return element;
}
function draw(name, attributes = {}, ...children) {
  const element = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) if (value !== null && value !== undefined) element.setAttribute(key, value);
  element.append(...children.filter(child => child !== null));
  return element;
}
function number(x, digits = 4) {
  if (x === null || x === undefined || Number.isNaN(x)) return "–";
  return (typeof x === "number" ? (Math.abs(x) >= 1e5 || (x && Math.abs(x) < 1e-3) ? x.toExponential(3) : String(+x.toPrecision(digits))) : String(x)).replace(/-(?=[\d.])/g, "−");
}
function fixed(x, digits) { return x === null || x === undefined || Number.isNaN(x) ? "–" : x.toFixed(digits).replace("-", "−"); }

function showTip(event, text) {
  const tip = $("tip");
  tip.textContent = text;
  tip.hidden = false;
  const box = tip.getBoundingClientRect();
  tip.style.left = `${Math.max(4, Math.min(event.clientX + 14, innerWidth - box.width - 8))}px`;
  tip.style.top = `${Math.max(4, Math.min(event.clientY + 14, innerHeight - box.height - 8))}px`;
}
function hideTip() { $("tip").hidden = true; }

// Texts beside their points, each where it covers nothing that came before it; what finds no place is left out.
const FEW_POINTS = 150;  // up to which each text is compared with all points: beyond, a picture would wait for it
const widthOf = text => 0.6 * text.length + 0.35 * (text.match(/[MW]/g) ?? []).length;  // in parts of its size
function placedTexts(labels, taken, size, inside = { x0: -Infinity, y0: -Infinity, x1: Infinity, y1: Infinity }) {
  const boxes = [...taken], texts = [];
  const free = b => b.x0 >= inside.x0 && b.x1 <= inside.x1 && b.y0 >= inside.y0 && b.y1 <= inside.y1 && !boxes.some(o => o.x0 < b.x1 && b.x0 < o.x1 && o.y0 < b.y1 && b.y0 < o.y1);
  const ways = [[0.7, 0.7], [0.7, -0.7], [-0.7, 0.7], [-0.7, -0.7], [1, 0], [-1, 0], [0, 1], [0, -1]];
  // a text nearer to another point than to its own reads as that one's; of flows, which have a size, nobody thinks so
  const points = labels.filter(one => one.size === undefined), few = points.length <= FEW_POINTS;
  const isOwn = (b, x, y) => {
    const cx = (b.x0 + b.x1) / 2, cy = (b.y0 + b.y1) / 2, apart = Math.hypot(cx - x, cy - y);
    return !few || points.every(o => (o.x === x && o.y === y) || Math.hypot(cx - o.x, cy - o.y) > apart);
  };
  for (const { x, y, r, words, look, first } of labels) {
    const spots = words.flatMap(text => [...(first ? [first] : []), ...ways].map(([dx, dy]) => {
      const w = size * widthOf(text), x0 = x + dx * r - (dx > 0.3 ? 0 : dx < -0.3 ? w : w / 2), y0 = y + dy * (r + size / 2) - size / 2;
      return { text, x0, y0, x1: x0 + w, y1: y0 + size };
    }));
    const at = spots.find(b => free(b) && isOwn(b, x, y)) ?? spots.find(free);
    if (!at) continue;
    boxes.push(at);
    const text = draw("text", { class: look, x: at.x0, y: at.y0 + 0.8 * size }, at.text);
    text.style.fontSize = `${size}px`;
    texts.push(text);
  }
  return texts;
}

// -- questions ------------------------------------------------------------------------------------------------------

const atWork = new Map();
function working(what, on) {
  on ? atWork.set(what, performance.now()) : atWork.delete(what);
  $("cancel").hidden = !atWork.size;
  tick();
}
function tick() {
  if (!atWork.size) { $("work").textContent = seen.timing.text || ""; return; }
  $("work").textContent = [...atWork].map(([what, begin]) => {
    const usual = seen.timing[what], since = (performance.now() - begin) / 1000;
    return `${what} … ${since.toFixed(1)} s${usual > 1 ? ` of about ${usual.toFixed(0)} s` : ""}${seen.timing[`said ${what}`] ? `, ${seen.timing[`said ${what}`]}` : ""}`;
  }).join("; ");
}
setInterval(tick, 200);

// The answer; undefined where a newer question took its place, null where it failed, which is said at `place` or at the top.
let questions = 0;  // a question that a cancel overtakes on its way is known by its number
async function ask(what, question, place = null) {
  if (SAVED) return savedAnswer(question);  // nothing is computed
  working(what, true);
  const begin = performance.now(), mine = atWork.get(what);
  let found;
  try {
    const response = await fetch("ask", { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify({ page: PAGE_ID, number: ++questions, ...question }) });
    found = response.ok ? await response.json() : { error: `the server refused the question (${response.status}); open the address that gfor explore printed` };
  } catch {
    found = { error: "the server does not answer; it ended, or was ended by Ctrl-C: start gfor explore again" };
  }
  const newer = atWork.has(what) && atWork.get(what) !== mine;  // of this name: it goes on being counted
  if (!newer) { working(what, false); delete seen.timing[`said ${what}`]; }
  if (found.superseded) return undefined;
  if (found.cancelled || found.closed) { failed("the computation was cancelled; the figures are those before it", place); return null; }
  if (found.error) { failed(found.error, place); return null; }
  seen.timing[what] = (performance.now() - begin) / 1000;
  const stamp = JSON.stringify(found.answer.stamp ?? null);
  if (seen.stamp && found.answer.stamp && stamp !== seen.stamp) failed("the case file was changed on disk; the figures are of the new one");
  if (found.answer.stamp) seen.stamp = stamp;
  return found.answer;
}
function failed(text, place = null) {
  const where = place ?? $("failure");
  where.textContent = text ?? "";
  where.hidden = !text;
}

// -- the state in the address ---------------------------------------------------------------------------------------

function keepState() {
  const kept = { s: state.scenario, v: state.values, r: state.range, c: state.controls, m: state.mode, t: state.tab, g: state.signals, p: state.pin, e: state.events, d: state.places };
  history.replaceState(null, "", `#${encodeURIComponent(JSON.stringify(kept))}`);
}
function readState(beginning) {
  Object.assign(state, { scenario: beginning.scenario, values: copyOf(beginning.values), range: beginning.range, controls: Object.keys(beginning.values) });
  try {
    const kept = JSON.parse(decodeURIComponent(location.hash.slice(1)));
    Object.assign(state, { scenario: String(kept.s), values: kept.v ?? {}, range: kept.r ?? [0.1, 2], controls: kept.c ?? [], mode: kept.m ?? null, tab: kept.t ?? "", signals: kept.g ?? "", pin: kept.p ?? null, events: kept.e ?? null, places: kept.d ?? {} });
  } catch { /* no state, or none that can be read: that of the command */ }
}

// -- files ----------------------------------------------------------------------------------------------------------

function download(name, kind, content) {
  const link = make("a", { download: name, href: URL.createObjectURL(content instanceof Blob ? content : new Blob([content], { type: kind })) });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}
const LOOKS = ["paint-order", "stroke", "stroke-width", "stroke-dasharray", "fill", "opacity", "font-size", "font-family"];
function pictureOf(svg) {
  const copy = svg.cloneNode(true), box = svg.getBoundingClientRect();
  const from = svg.querySelectorAll("*"), to = copy.querySelectorAll("*");
  from.forEach((element, k) => { const style = getComputedStyle(element); for (const look of LOOKS) to[k].setAttribute(look, style.getPropertyValue(look)); });
  copy.setAttribute("xmlns", SVG);
  copy.setAttribute("width", box.width);
  copy.setAttribute("height", box.height);
  if (!copy.getAttribute("viewBox")) copy.setAttribute("viewBox", `0 0 ${box.width} ${box.height}`);
  copy.prepend(draw("rect", { width: "100%", height: "100%", fill: getComputedStyle(document.documentElement).getPropertyValue("--paper") }));
  return new XMLSerializer().serializeToString(copy);
}
function asPng(svg, name) {
  const picture = new Image(), box = svg.getBoundingClientRect();
  picture.onload = () => {
    const canvas = make("canvas", { width: 2 * box.width, height: 2 * box.height });
    canvas.getContext("2d").drawImage(picture, 0, 0, canvas.width, canvas.height);
    canvas.toBlob(blob => download(name, "image/png", blob));
  };
  picture.src = `data:image/svg+xml;charset=utf-8,${encodeURIComponent(pictureOf(svg))}`;
}
function asCsv(rows) {
  const cell = x => { const text = String(x ?? ""); return /[",\n]/.test(text) || /^[=+@]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text; };
  return rows.map(row => row.map(cell).join(",")).join("\n") + "\n";
}

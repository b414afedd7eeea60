"use strict";
// The loop of one short-circuit ratio, scaled to any other; verdicts are those of the ratios that were judged.
const held = JSON.parse(document.getElementById("held").textContent), at = id => document.getElementById(id);
const COLOURS = ["var(--one)", "var(--two)"], WIDEST = 460, first = held.judged[0].ratio, last = held.judged.at(-1).ratio;
let reach = 3;
const within = (x, low, high) => Math.min(high, Math.max(low, x));
const figure = (x, digits = 3) => String(+x.toPrecision(digits)).replace("-", "−");
function draw(name, attributes, text) {
  const element = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  if (text) element.textContent = text;
  return element;
}
// Least singular value of 1 + factor·L of two rows, and where it is.
function distanceOf(factor) {
  let least = Infinity, where = 0;
  const [ar, ai, br, bi, cr, ci, dr, di] = held.loop;
  held.hertz.forEach((f, k) => {
    const a = [1 + factor * ar[k], factor * ai[k]], b = [factor * br[k], factor * bi[k]], c = [factor * cr[k], factor * ci[k]], d = [1 + factor * dr[k], factor * di[k]];
    const size = [a, b, c, d].reduce((sum, [x, y]) => sum + x * x + y * y, 0);
    const re = a[0] * d[0] - a[1] * d[1] - b[0] * c[0] + b[1] * c[1], im = a[0] * d[1] + a[1] * d[0] - b[0] * c[1] - b[1] * c[0], product = re * re + im * im;
    const small = Math.sqrt(Math.max(0, 2 * product / (size + Math.sqrt(Math.max(0, size * size - 4 * product)))));
    if (small < least) { least = small; where = f; }
  });
  return { least, where };
}
// The verdict of both judged neighbours, where they agree.
function verdictAt(ratio) {
  const below = held.judged.filter(one => one.ratio <= ratio * (1 + 1e-9)).at(-1) ?? held.judged[0], above = held.judged.find(one => one.ratio >= ratio * (1 - 1e-9)) ?? held.judged.at(-1);
  return below.verdict === above.verdict ? { verdict: below.verdict, why: below.reasons[0] ?? "" } : { verdict: "not known", why: `${below.verdict} at ${figure(below.ratio)}, ${above.verdict} at ${figure(above.ratio)}` };
}
function paint() {
  const begin = performance.now(), ratio = first * (last / first) ** (at("ratio").value / 1000), factor = held.ratio / ratio, { least, where } = distanceOf(factor), said = verdictAt(ratio);
  at("shown").textContent = figure(ratio);
  at("verdict").className = { stable: "good", unstable: "bad" }[said.verdict] ?? "soft";
  at("verdict").style.fontWeight = 600;
  at("verdict").textContent = `${said.verdict === "unstable" ? "UNSTABLE" : said.verdict} at a short-circuit ratio of ${figure(ratio)}${said.why ? ` (${said.why})` : ""}; distance from −1: ${figure(least)} at ${figure(where)} Hz`;
  const SIDE = Math.min(WIDEST, at("plane").parentElement.clientWidth);  // so that its words have the page's size
  const x = v => SIDE / 2 + v / reach * SIDE / 2, y = v => SIDE / 2 - v / reach * SIDE / 2, parts = [];
  for (let k = -Math.floor(reach); k <= reach; k++) {
    parts.push(draw("path", { class: k ? "grid" : "axis", d: `M${x(k)} 0V${SIDE}M0 ${y(k)}H${SIDE}` }));
    if (k && k % Math.ceil(reach / 4) === 0) parts.push(draw("text", { class: "faint", x: within(x(k) - 4, 2, SIDE - 16), y: y(0) + 20 }, figure(k)), draw("text", { class: "faint", x: x(0) + 4, y: within(y(k) + 4, 11, SIDE - 4) }, `${figure(k)}j`));
  }
  parts.push(draw("circle", { cx: x(0), cy: y(0), r: SIDE / 2 / reach, fill: "none", style: "stroke:var(--circle)" }), draw("circle", { cx: x(-1), cy: y(0), r: least * SIDE / 2 / reach, fill: "none", style: "stroke:var(--bad)", "stroke-dasharray": "5 4" }), draw("path", { d: `M${x(-1) - 6} ${y(0)}h12m-6 -6v12`, style: "stroke:var(--bad)", "stroke-width": 2 }));
  for (let k = 0; k < held.loci.length / 2; k++) for (const side of [1, -1]) {
    const d = held.loci[2 * k].map((re, i) => `${i ? "L" : "M"}${x(re * factor).toFixed(1)} ${y(side * held.loci[2 * k + 1][i] * factor).toFixed(1)}`).join("");
    parts.push(draw("path", { d, fill: "none", style: `stroke:${COLOURS[k % 2]}`, "stroke-width": side > 0 ? 2 : 1, ...(side < 0 ? { "stroke-dasharray": "2 3" } : {}) }));
  }
  at("plane").setAttribute("viewBox", `0 0 ${SIDE} ${SIDE}`);
  at("plane").style.cssText = `max-width:${SIDE}px;overflow:hidden;border:1px solid var(--line)`;
  at("plane").replaceChildren(...parts);
  for (const row of at("ratios").tBodies[0]?.rows ?? []) row.style.fontWeight = Math.abs(Math.log(row.dataset.ratio / ratio)) < Math.log(last / first) / 2 / (held.judged.length - 1) ? 700 : 400;
  document.body.dataset.painted = (performance.now() - begin).toFixed(1);
}
function begin() {
  const unstable = held.judged.filter(one => one.verdict === "unstable"), stable = held.judged.filter(one => one.verdict === "stable"), open = held.judged.filter(one => one.verdict === "not known"), unknown = open.length;
  const words = !unstable.length && !unknown ? `Stable at every ratio from ${figure(first)} to ${figure(last)}.`
    : !stable.length && !unknown ? `Unstable at every ratio from ${figure(first)} to ${figure(last)}.`
      : unstable.length && stable.length && unstable.at(-1).ratio < stable[0].ratio ? `Unstable up to a ratio of ${figure(unstable.at(-1).ratio)}, stable from ${figure(stable[0].ratio)} on.`
        : `Of ${held.judged.length} ratios ${stable.length} are stable and ${unstable.length} unstable.`;
  at("boss").textContent = `${words}${unknown ? ` At ${open.map(one => figure(one.ratio)).join(", ")} the verdict is not known: ${open[0].reasons[0]}.` : ""}`;
  at("error").textContent = `The loop is in inverse proportion to the ratio: the page computes what it draws at any ratio, and interpolates nothing. At the ${held.judged.length} ratios that were judged, its distance from −1 is off by ${figure(held.off, 2)} at most. Between two of them the verdict is said where both agree.`;
  const cell = (tag, text, look = "") => { const one = document.createElement(tag); one.textContent = text; one.className = look; return one; }, row = (...cells) => { const one = document.createElement("tr"); one.append(...cells); return one; };
  const head = document.createElement("thead"), body = document.createElement("tbody");
  head.append(row(cell("th", "Ratio"), cell("th", "Verdict", "text"), cell("th", "Distance from −1"), cell("th", "At [Hz]")));
  for (const one of held.judged) {
    const line = row(cell("td", figure(one.ratio)), cell("td", one.verdict === "unstable" ? "UNSTABLE" : one.verdict, `text ${{ stable: "good", unstable: "bad" }[one.verdict] ?? "soft"}`), cell("td", one.distance === null ? "–" : figure(one.distance)), cell("td", one.at_hz === null ? "–" : figure(one.at_hz)));
    line.dataset.ratio = one.ratio;
    body.append(line);
  }
  at("ratios").append(head, body);
  for (const [text, colour] of [["first locus", COLOURS[0]], ["second locus", COLOURS[1]], ["unit circle", "var(--circle)"], ["−1, and the distance from it", "var(--bad)"]]) {
    const line = document.createElement("li"), mark = document.createElement("i");
    mark.style.background = colour;
    line.append(mark, text);
    at("key").append(line);
  }
  for (const [text, factor] of [["further off", 2], ["nearer", 0.5]]) {
    const button = document.createElement("button");
    button.textContent = text;
    button.addEventListener("click", () => { reach = Math.max(1.5, Math.min(48, reach * factor)); paint(); });
    at("key").append(button);
  }
  at("ratio").value = 500;
  at("ratio").addEventListener("input", paint);
  addEventListener("resize", paint);
  paint();
}
begin();

"use strict";
// Values by name: found, set by sliders, estimated while a slider is dragged, computed on its release.
const parameterOf = name => seen.info?.parameters.find(p => p.parameter === name) ?? null;
const original = name => { const p = parameterOf(name); return p ? (name in seen.originals ? seen.originals[name] : p.value) : null; };
seen.originals = {};

function paintFound() {
  const words = $("search").value.toLowerCase().split(/\s+/).filter(Boolean);
  const all = seen.info?.parameters ?? [];
  const fits = words.length ? all.filter(p => words.every(w => `${p.parameter} ${p.description}`.toLowerCase().includes(w))) : [];
  fits.sort((a, b) => (a.variability === "tunable" ? 0 : 1) - (b.variability === "tunable" ? 0 : 1));
  $("found").replaceChildren(...fits.slice(0, 40).map(p => {
    const button = make("button", {}, make("b", {}, p.parameter), ` = ${number(p.value)} ${p.unit === "1" ? "" : p.unit}`, make("small", {}, p.description));
    button.addEventListener("click", () => addControl(p.parameter));
    return make("li", {}, button);
  }), ...(fits.length > 40 ? [make("li", { class: "soft" }, `and ${fits.length - 40} more; write more of the name`)] : []),
  ...(words.length && !fits.length && seen.info ? [make("li", { class: "soft" }, "no parameter has these words")] : []));
}
function addControl(name) {
  if (!state.controls.includes(name)) state.controls.push(name);
  keepState();
  paintControls();
  document.querySelector(`.control[data-name="${CSS.escape(name)}"] input`)?.focus();
}
// Where a slider goes from and to: around the value, within the bounds; in equal ratios where all is above 0.
function scaleOf(p) {
  const value = typeof p.value === "number" ? p.value : 0, least = p.minimum ?? -Infinity, most = p.maximum ?? Infinity;
  if (value > 0) {
    const low = Math.max(value / 5, least > 0 ? least : 0), high = Math.min(value * 5, most);
    return { low, high, to: x => low * (high / low) ** x, from: v => Math.log(v / low) / Math.log(high / low) };
  }
  const size = Math.abs(value) || 1, low = Math.max(value - size, least), high = Math.min(value + size, most);
  return { low, high, to: x => low + x * (high - low), from: v => (v - low) / (high - low) };
}

// The same room for each step between computed values.
function scaleThrough(values) {
  const last = values.length - 1, below = x => Math.max(0, Math.min(last - 1, x));
  const to = x => { const k = below(Math.floor(x * last)); return last ? values[k] + (x * last - k) * (values[k + 1] - values[k]) : values[0]; };
  const from = v => { const k = below(values.findLastIndex(one => one <= v)); return last ? (k + (v - values[k]) / (values[k + 1] - values[k])) / last : 0; };
  return { low: values[0], high: values[last], to, from };
}

function paintControls() {
  const focused = document.activeElement?.closest?.(".control")?.dataset.name, kind = document.activeElement?.type;
  $("controls").replaceChildren(...state.controls.map(name => controlOf(name)));
  paintMovers(true);
  if (focused) document.querySelector(`.control[data-name="${CSS.escape(focused)}"] input[type="${kind === "range" ? "range" : kind === "text" ? "text" : "checkbox"}"]`)?.focus({ preventScroll: true });
}
// Why a saved page's slider goes no further, where that is a bound or nothing could be computed beyond.
function wordsOfEnds(name, held) {
  const { below, above } = SAVED.ends?.[name] ?? {}, [low, high] = [number(held[0]), number(held.at(-1))];
  if (below && below === above) return `beyond ${low} and ${high}: ${below}`;
  return [below && `below ${low}: ${below}`, above && `above ${high}: ${above}`].filter(Boolean).join("; ");
}
// A value's slider or switch; `mover` tells what it does to the mode, where it is one of those that move it most.
function controlOf(name, mover = null) {
  const p = parameterOf(name);
  const box = make("div", { class: "control", "data-name": name });
  const value = state.values[name] ?? p?.value;
  const error = make("span", { class: "error", role: "alert" });
  const away = make("button", { title: "back to the case's value", "aria-label": `take ${name} back` }, "×");
  away.addEventListener("click", () => { if (!SAVED) state.controls = state.controls.filter(n => n !== name); setValue(name, null); paintControls(); });
  const unit = p && p.unit !== "1" ? p.unit : "";
  box.append(make("div", { class: "row" }, make("b", {}, name), make("span", { class: "grow" }), (mover || SAVED) && !(name in state.values) ? null : away));
  if (mover) box.append(make("p", { class: "effect" }, effectOf(mover)));
  if (p?.type === "Boolean") {
    const tick = make("input", { type: "checkbox", "aria-label": name });
    tick.checked = value === true;
    tick.addEventListener("change", () => setValue(name, tick.checked, error));
    box.append(make("label", { class: "row" }, tick, " on"));
  } else {
    const field = make("input", { type: "text", value: value ?? "", "aria-label": `${name} in ${unit || "1"}`, inputmode: "decimal" });
    field.addEventListener("change", () => {
      const given = field.value.trim().replace(",", ".").replace("−", "-"), x = Number(given);
      setValue(name, given !== "" && Number.isFinite(x) ? x : field.value.trim(), error);
    });
    const row = make("div", { class: "row" }, field, make("span", { class: "soft" }, unit));
    if (p && typeof p.value === "number" && p.type === "Real") {
      const held = SAVED?.grid[name], scale = held ? scaleThrough(held) : scaleOf({ ...p, value: original(name) });
      const slider = make("input", { type: "range", min: 0, max: 1000, step: 1, "aria-label": `${name}, from ${number(scale.low)} to ${number(scale.high)} ${unit}` });
      slider.value = typeof value === "number" ? Math.round(1000 * Math.min(1, Math.max(0, scale.from(value)))) : 0;
      const at = () => +scale.to(slider.value / 1000).toPrecision(4);
      for (const begin of ["pointerdown", "focus"]) slider.addEventListener(begin, () => wantSlopes(name));
      slider.addEventListener("input", () => { field.value = at(); estimateAt(name, at()); });
      slider.addEventListener("change", () => setValue(name, at(), error));
      row.prepend(slider);
    }
    box.append(row);
    if (p && typeof p.value === "number" && p.type === "Real" && !SAVED) {
      const finder = finderOf(`${state.scenario} ${name}`, {
        now: () => state.values[name] ?? original(name), bounds: () => [p.minimum ?? -Infinity, p.maximum ?? Infinity],
        valuesAt: x => ({ [name]: x }), apply: x => setValue(name, x), words: name.split(".").at(-1),
      });
      box.append(mover ? make("details", { open: seen.unfolded === name ? "" : null }, make("summary", {}, "find a value"), finder) : finder);
    }
  }
  const held = SAVED?.grid[name];
  const bounds = held ? `, computed from ${number(held[0])} to ${number(held.at(-1))}` : p && (p.minimum !== null || p.maximum !== null) ? `, from ${p.minimum === null ? "any" : number(p.minimum)} to ${p.maximum === null ? "any" : number(p.maximum)}` : "";
  const ends = held ? wordsOfEnds(name, held) : "";
  if (ends) box.append(make("small", { class: "block" }, ends));
  if (mover) box.append(make("small", { class: "short", title: p?.description }, p?.description ?? ""));
  box.append(make("small", { hidden: mover ? "" : null }, p ? `${p.description}${p.description ? "; " : ""}${p.variability}${bounds}; ${number(original(name))} in the case` : "this scenario has no such parameter"), error);
  for (const off of (p?.switches ?? []).filter(one => (state.values[one] ?? original(one)) === false)) {
    const on = make("button", {}, `switch ${off} on`);
    on.addEventListener("click", () => setValue(off, true, error));
    box.append(make("small", { class: "idle" }, `${name} cannot act: ${off} is off. `, SAVED ? "" : on));
  }
  if (SAVED && !SAVED.grid[name]) box.querySelectorAll("input").forEach(input => { input.disabled = true; });
  return box;
}

// -- a value that is looked for -----------------------------------------------------------------------------------

const LADDER = [1.3, 1.7, 2.3, 3, 4, 5.5, 8, 12, 25, 100], HALVES_TO_AN_EDGE = 5;
// How many values of the ladder are tried in any case, a little beyond the slider's ends, and which one is far out.
const TRIED_FIRST = LADDER.indexOf(5.5) + 1, FAR_OUT = LADDER.indexOf(25);
const reasonOf = text => { const reason = (text.split("\n")[1] ?? text).replace(/^\s*- /, ""); return reason.length > 200 ? `${reason.slice(0, 200)} …` : reason; };
// Values that are tried upwards and downwards of `now`: in growing ratios, or steps where it is not above 0, and the
// bounds; without a declared one, a value above 0 goes down to a part of itself.
function ladders(now, least, most) {
  if (now > 0 && least === -Infinity) least = now / 25;
  const up = LADDER.map(k => (now > 0 ? now * k : now + (k - 1) * (Math.abs(now) || 1)));
  const down = LADDER.map(k => (now > 0 ? now / k : now - (k - 1) * (Math.abs(now) || 1)));
  if (now > 0 && least < 0 && Number.isFinite(least)) down.push(0, 0.1 * least, 0.3 * least);
  const within = (values, bound) => [...values.map(x => +x.toPrecision(6)).filter(x => x > least && x < most), ...(Number.isFinite(bound) && bound !== now ? [bound] : [])];
  return [within(up, most), within(down, least)];
}
// Why a side of a search goes no further, by the slope between its last two values; "" where it may meet the damping.
function whyNoFurther({ before, last, far }, percent) {
  const x = last.x - last.f * (last.x - before.x) / (last.f - before.f), way = Math.sign(last.x - before.x);
  if (!Number.isFinite(x) || way * (x - last.x) <= 0) return `the slope there does not lead to ${number(percent)} %`;
  return way * (x - far) > 0 ? `by the slope there ${number(percent)} % lies near ${number(x, 2)}, far out` : "";
}
// Looks for values at which the least damped mode of the range reaches so many percent, beyond the slider only as far as
// the slope leads there, or at which stability is lost, to the ends: the
// smallest change first (the smallest ratio, where it is stability), which a damping also sets. `spec`: what it is `now`, its `bounds`, `valuesAt`, which makes the case's values from one number,
// `apply`, which sets one, and its `words`. One per key, so that what was found stays while the controls are painted anew.
function finderOf(key, spec) {
  const one = seen.finders[key] ??= finder(spec), others = one.others();
  if (others !== one.of) { one.of = others; one.said.replaceChildren(); }
  return one.box;
}
// Where the least damped mode has so many percent, to first order, by what is known of ∂λ/∂p; null where nothing is.
function nearBy(name, percent) {
  const one = seen.moversOf === state.scenario && !seen.moversStale ? seen.movers?.movers.find(mover => mover.parameter === name) : null;
  const x = one ? one.value + (percent - seen.movers.damping_percent) * one.step / one.points : NaN;
  return Number.isFinite(x) && x >= (one.minimum ?? -Infinity) && x <= (one.maximum ?? Infinity) && x * one.value > 0 ? x : null;
}
// What grows, in a few words: how fast, at which frequency, and in which components.
function growthOf({ largest_growth_rate: rate, frequency_hz: hertz, participation, common_speed, sentence }) {
  if (rate === null || !participation.length) return sentence;
  if (common_speed.length) return `the common speed drifts at ${signed(rate, 2)} 1/s without a governor, all machines alike`;
  const where = [...new Set(participation.slice(0, 3).map(one => one.state.split(".")[0]))].join(" and ");
  return `a mode grows at ${signed(rate, 2)} 1/s (${hertz ? `${number(hertz, 3)} Hz` : "no oscillation"}, in ${where})`;
}
function finder({ now, bounds, valuesAt, apply, words }) {
  const names = Object.keys(valuesAt(1)), wanted = make("input", { value: 5, size: 3, inputmode: "decimal", "aria-label": `damping in % that ${words} is looked for` }), said = make("span", { class: "soft block", role: "status" }), begin = make("button", {}, "find"), until = make("button", { title: "the whole spectrum, aperiodic growth too" }, "until unstable");
  const say = text => { said.textContent = text; };
  const search = async (percent, sets = true, tell = () => {}) => {  // null: until unstable; `tell` hears the first answers
    if (percent !== null && Number.isFinite(percent)) wanted.value = percent;
    if (!(percent === null || (percent > -100 && percent < 100))) { say("give a damping in percent"); return; }
    const here = now(), [least, most] = bounds(), error = make("span"), cancels = seen.cancels, tried = [];
    const holds = one => { const damping = Math.min(100, ...one.modes.map(m => m.damping_percent)); if (percent !== null) { const f = (one.stable === false ? Math.min(damping, -1e-9) : damping) - percent; return { damping, f, g: f }; } const f = { true: 1, false: -1 }[one.stable] ?? null; return { damping, f, g: damping * f > 0 ? damping : null }; };
    let stopped = "";
    const at = async x => {  // null where nothing is known, and where the search ends
      say(`${words} ${number(x, 6)} …, ${tried.length} values tried`);
      error.textContent = "";
      const values = Object.fromEntries(Object.entries({ ...state.values, ...valuesAt(x) }).filter(([, value]) => value !== null));
      const found = await ask("search", { ask: "modes", ...theCase(), values, range: state.range }, error);
      if (found === undefined) stopped = "another question took its place: find again";
      else if (seen.cancels !== cancels) stopped = "cancelled";
      else if (found) {
        const idle = Object.keys(valuesAt(x)).map(name => found.idle[name] && `${name} cannot act: ${found.idle[name]}`).filter(Boolean);
        if (idle.length) { stopped = idle.join("; "); return null; }
        const point = { x, stability: found.modes.scenarios[0].stability, ...holds(found.modes.scenarios[0]) };
        if (point.f !== null) { tried.push(point); return point; }
        error.textContent = `the verdict is not known: ${found.verdict}`;
      }
      return null;
    };
    const byDerivative = nearBy(names.length === 1 ? names[0] : null, percent ?? 0);
    if (byDerivative !== null) tell(`about ${number(byDerivative, 3)} by ∂λ/∂p at ${number(here)} (≈); being computed …`);
    const first = await at(here), edges = [], crossings = [];
    if (!first) { say(stopped || error.textContent); return; }
    const text = ({ good, bad }) => (percent === null ? `stable ${bad.x > good.x ? "up" : "down"} to ${words} ${number(good.x, 6)}, UNSTABLE at ${number(bad.x, 6)}${bad.stability.cause === "coupling" ? ", by the communication step and not by the system" : ""}: ${growthOf(bad.stability)}`
      : `${fixed(good.damping, 2)} % at ${words} ${number(good.x, 6)}; ${bad.x > good.x ? "above" : "below"} it is less than ${number(percent)} %${bad.f < -percent ? " (unstable)" : ""}`);
    // Between two points of which one holds: to 0.00 %, or to 2e-4 of the value; by secants, every third time by halves.
    const crossingIn = async (a, b) => {
      for (let n = 0; n < 40 && !stopped; n++) {
        const good = a.f >= 0 ? a : b, secant = a.g !== null && b.g !== null && n % 3 !== 2;
        let part = secant ? (a.g - (percent === null ? 0 : 0.002)) / (a.g - b.g) : 0.5;
        if (secant && percent === null) part += (part < 0.5 ? 1 : -1) * 8e-5 * Math.abs(a.x / (b.x - a.x));  // a little beyond, so that both ends come close
        const x = +(a.x + Math.min(0.999, Math.max(0.001, part)) * (b.x - a.x)).toPrecision(6);
        if ((percent !== null && good.f < 0.004) || x === a.x || x === b.x || (percent === null && Math.abs(b.x - a.x) < 2e-4 * Math.abs(b.x))) break;
        const point = await at(x);
        if (!point) break;
        if (point.f < 0 === a.f < 0) a = point; else b = point;
      }
      const found = a.f >= 0 ? { good: a, bad: b } : { good: b, bad: a };
      crossings.push(found);
      if (crossings.length === 1 && !stopped) tell(`${text(found)}; others are looked for …`);
    };
    // Upwards and downwards in turn, so that the nearest comes first; what changes between neighbours is found at once.
    const sides = ladders(here, least, most).map((values, down) => ({ values, last: first, done: 0, far: (here > 0 && down ? null : values[FAR_OUT]) ?? values.at(-1) }));
    const walk = async (side, x) => {
      const point = await at(x), before = side.last;
      if (point) { Object.assign(side, { before, last: point }); if (point.f < 0 !== before.f < 0) await crossingIn(before, point); }
      return point;
    };
    while (sides.some(side => side.values.length)) for (const side of sides.filter(one => one.values.length)) {
      const x = side.values.shift(), point = await walk(side, x);
      if (stopped) { say(stopped); return; }
      if (point) {
        side.done += 1;
        const why = percent !== null && side.done >= TRIED_FIRST && side.values.length ? whyNoFurther(side, percent) : "";
        if (why) { edges.push(`not tried ${x > here ? "above" : "below"} ${number(x)}: ${why}`); side.values = []; }
        continue;
      }
      let edge = { x, why: error.textContent };
      for (let k = 0; k < HALVES_TO_AN_EDGE; k++) {
        const middle = +((side.last.x + edge.x) / 2).toPrecision(6), beside = await walk(side, middle);
        if (stopped) { say(stopped); return; }
        if (!beside) edge = { x: middle, why: error.textContent };
      }
      edges.push(`not computed from ${number(edge.x)} on: ${reasonOf(edge.why)}`);
      side.values = [];
    }
    const line = [...tried].sort((a, b) => a.x - b.x), range = `${line.length} values were tried from ${number(line[0].x)} to ${number(line.at(-1).x)}`, tail = ["", range, ...edges].join("; ");
    if (!crossings.length) {
      const best = line.reduce((a, b) => (Math.abs(b.f) < Math.abs(a.f) ? b : a));
      say((percent !== null ? `not reached; nearest: ${fixed(best.damping, 2)} % at ${number(best.x)}` : `${first.f > 0 ? "stable" : "UNSTABLE"} over the whole range, ${words} from ${number(line[0].x)} to ${number(line.at(-1).x)}`) + tail);
      return;
    }
    const far = ({ good: { x } }) => (percent === null && here > 0 ? (x > 0 ? Math.abs(Math.log(x / here)) : Infinity) : Math.abs(x - here));
    crossings.sort((a, b) => far(a) - far(b));
    if (percent !== null && sets) await apply(crossings[0].good.x);
    said.replaceChildren(...crossings.flatMap((one, k) => {
      const button = make("button", {}, "set");
      button.addEventListener("click", () => apply(one.good.x));
      return [k ? "also " : "", text(one), " ", button, make("br")];
    }), tail.slice(2));
    return () => apply(crossings[0].good.x);
  };
  begin.addEventListener("click", () => search(Number(wanted.value.trim().replace(",", ".") || NaN)));
  until.addEventListener("click", () => search(null));
  const others = () => JSON.stringify([state.scenario, state.range, Object.entries(state.values).filter(([name]) => !names.includes(name)).sort()]);
  return { said, search, others, of: others(), box: make("div", { class: "finder" }, make("label", {}, "least damped at ", wanted, " % "), begin, " or ", until, said) };
}

async function setValue(name, value, place = null) {
  const before = copyOf(state.values);
  if (SAVED && value !== null) { seen.dragged = null; await setSaved(name, value); return; }
  if (value === null || (same(value, original(name)) && !(name in (seen.beginning?.values ?? {})))) delete state.values[name]; else state.values[name] = value;
  seen.moved = name;
  if (same(before, state.values)) { seen.estimate = null; paintMap(); paintTable(); return; }
  keepState();
  paintControls();
  const error = document.querySelector(`.control[data-name="${CSS.escape(name)}"] .error`) ?? place;
  await compute(error);
}

// -- estimates ------------------------------------------------------------------------------------------------------

const slopeKey = name => JSON.stringify([state.scenario, state.values, state.range, name]);
async function wantSlopes(name) {
  const key = slopeKey(name);
  if (SAVED || key in seen.slopes) return;
  seen.slopes[key] = null;
  const found = await ask("∂λ/∂p", { ask: "slopes", ...theCase(), range: state.range, parameter: name }, document.createElement("span"));
  if (found) seen.slopes[key] = found; else delete seen.slopes[key];
  const keys = Object.keys(seen.slopes);
  for (const old of keys.slice(0, Math.max(0, keys.length - 40))) delete seen.slopes[old];
}
function estimateAt(name, value) {
  const begin = performance.now(), found = seen.slopes[slopeKey(name)];
  if (SAVED) { dragSaved(name, value); return; }
  if (!found || found.eigenvalues.length !== seen.modes.length) { wantSlopes(name); return; }
  const modes = found.eigenvalues.map(([re, im], k) => {
    const slope = found.slopes[k];
    if (!slope) return null;
    const real = re + slope[0] * (value - found.value), imag = im + slope[1] * (value - found.value);
    return { real, imag, hz: imag / 2 / Math.PI, damping: -100 * real / Math.hypot(real, imag) };
  });
  seen.estimate = { name, value, modes };
  paintMap(); paintTable();
  const least = modes.filter(Boolean).sort((a, b) => a.damping - b.damping)[0];
  $("verdict").className = "estimated";
  if (least) $("verdict").textContent = estimated(name, value, least, 1, "by ∂λ/∂p");
  paintOutside(`Computed before, with ${name} = ${number(state.values[name] ?? original(name))}: `);
  painted(begin, "estimate");
}
// The verdict while a slider is dragged, in a live page and in a saved one.
const estimated = (name, value, least, digits, how) => `${name} = ${number(value)}: least damped ≈ ${fixed(least.hz, 3)} Hz, ${fixed(least.damping, digits)} % (estimated ${how}); ${SAVED ? "the nearest computed value" : "computed"} on release`;
// How long it took from the input until the map was painted.
function painted(begin, what) {
  requestAnimationFrame(() => setTimeout(() => {
    const ms = performance.now() - begin;
    seen.timing[`${what} ms`] = ms;
    document.body.dataset[what] = ms.toFixed(1);
    document.body.dataset[`${what}Count`] = +(document.body.dataset[`${what}Count`] ?? 0) + 1;
    if (!SAVED) seen.timing.text = `${what === "exact" ? "modes computed and drawn" : "estimate drawn"} within ${ms < 1000 ? `${ms.toFixed(0)} ms` : `${(ms / 1000).toFixed(1)} s`}`;
    tick();
  }, 0));
}

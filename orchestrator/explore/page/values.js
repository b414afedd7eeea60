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

function paintControls() {
  const focused = document.activeElement?.closest?.(".control")?.dataset.name, kind = document.activeElement?.type;
  $("controls").replaceChildren(...state.controls.map(name => {
    const p = parameterOf(name);
    const box = make("div", { class: "control", "data-name": name });
    const value = state.values[name] ?? p?.value;
    const error = make("span", { class: "error", role: "alert" });
    const away = make("button", { title: "back to the case's value", "aria-label": `take ${name} back` }, "×");
    away.addEventListener("click", () => { state.controls = state.controls.filter(n => n !== name); setValue(name, null); paintControls(); });
    const unit = p && p.unit !== "1" ? p.unit : "";
    box.append(make("div", { class: "row" }, make("b", {}, name), make("span", { class: "grow" }), away));
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
        const held = SAVED?.grid[name], least = held && Math.min(...held), most = held && Math.max(...held);
        const scale = held ? { low: least, high: most, to: x => least + x * (most - least), from: v => (v - least) / (most - least) } : scaleOf({ ...p, value: original(name) });
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
        const scale = scaleOf({ ...p, value: original(name) });
        box.append(finder(value, scale.low, scale.high, x => ({ [name]: x }), async (x, text) => {
          await setValue(name, x, error);
          const status = document.querySelector(`.control[data-name="${CSS.escape(name)}"] [role="status"]`);
          if (status) status.textContent = text;
        }, name.split(".").at(-1)));
      }
    }
    const bounds = p && (p.minimum !== null || p.maximum !== null) ? `, from ${p.minimum === null ? "any" : number(p.minimum)} to ${p.maximum === null ? "any" : number(p.maximum)}` : "";
    box.append(make("small", {}, p ? `${p.description}${p.description ? "; " : ""}${p.variability}${bounds}; ${number(original(name))} in the case` : "this scenario has no such parameter"), error);
    if (SAVED && !SAVED.grid[name]) box.querySelectorAll("input").forEach(input => { input.disabled = true; });
    return box;
  }));
  if (focused) document.querySelector(`.control[data-name="${CSS.escape(focused)}"] input[type="${kind === "range" ? "range" : kind === "text" ? "text" : "checkbox"}"]`)?.focus({ preventScroll: true });
}

// -- a value that is looked for -----------------------------------------------------------------------------------

// Where the least damped mode of the range reaches so many percent: outwards from the value in steps, then by halves.
// `valuesAt` makes the case's values from one number, `apply` sets what was found.
function finder(now, low, high, valuesAt, apply, words) {
  const wanted = make("input", { value: 5, size: 3, inputmode: "decimal", "aria-label": `damping in % that ${words} is looked for` }), said = make("span", { class: "soft block", role: "status" }), begin = make("button", {}, "find");
  const search = async () => {
    const percent = Number(wanted.value.replace(",", ".")), error = make("span"), tried = [];
    if (!(percent > -100 && percent < 100)) { said.textContent = "give a damping in percent"; return; }
    const above = async x => {
      said.textContent = `${words} ${number(x)} …`;
      const values = Object.fromEntries(Object.entries({ ...state.values, ...valuesAt(x) }).filter(([, value]) => value !== null));
      const found = await ask("search", { ask: "modes", ...theCase(), values, range: state.range }, error);
      if (!found) return found;
      const one = found.modes.scenarios[0], least = Math.min(100, ...one.modes.map(m => m.damping_percent));
      tried.push({ x, f: (one.stable === false ? Math.min(least, -1e-9) : least) - percent });
      return tried.at(-1).f;
    };
    const here = await above(now), ends = [{ x: now, f: here, to: high }, { x: now, f: here, to: low }];
    if (here === undefined || here === null) { said.textContent = error.textContent || "a newer question took its place"; return; }
    let bracket = null;
    for (let k = 1; k <= 5 && !bracket; k++) {
      for (const end of ends.filter(e => !e.refused && e.to !== now)) {
        const x = now > 0 && low > 0 ? now * (end.to / now) ** (k / 5) : now + (end.to - now) * k / 5, f = await above(x);
        if (f === undefined) { said.textContent = ""; return; }
        if (f === null) { end.refused = true; continue; }
        if (f < 0 !== here < 0) { bracket = [end, { x, f }]; break; }
        Object.assign(end, { x, f });
      }
    }
    if (!bracket) {
      const best = tried.reduce((a, b) => (Math.abs(b.f) < Math.abs(a.f) ? b : a));
      said.textContent = `not reached at ${tried.length} values from ${number(ends[1].x)} to ${number(ends[0].x)}; nearest: ${fixed(best.f + percent, 2)} % at ${number(best.x)}${error.textContent ? `; ${error.textContent}` : ""}`;
      return;
    }
    let [a, b] = bracket;
    for (let k = 0; k < 20 && Math.abs(b.x - a.x) > 1e-3 * Math.abs(b.x); k++) {
      const part = Math.min(0.9, Math.max(0.1, a.f / (a.f - b.f))), x = a.x + part * (b.x - a.x), f = await above(x);
      if (f === undefined || f === null) { said.textContent = error.textContent; return; }
      if (f < 0 === a.f < 0) a = { x, f }; else b = { x, f };
      if (Math.abs(f) < 0.005) break;
    }
    const good = a.f >= 0 ? a : b;
    const text = `${fixed(good.f + percent, 2)} % at ${words} ${number(good.x)}; beyond ${number(a.f >= 0 ? b.x : a.x)} it is below ${number(percent)} %`;
    await apply(+good.x.toPrecision(6), text);
  };
  begin.addEventListener("click", search);
  return make("div", { class: "finder" }, make("label", {}, "least damped at ", wanted, " % "), begin, said);
}

async function setValue(name, value, place = null) {
  const before = copyOf(state.values);
  if (value === null || (same(value, original(name)) && !(name in (seen.beginning?.values ?? {})))) delete state.values[name]; else state.values[name] = value;
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
  if (SAVED) { state.values[name] = value; compute(); return; }
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
  if (least) $("verdict").textContent = `estimate at ${name} = ${number(value)}: least damped ≈ ${fixed(least.hz, 3)} Hz, ${fixed(least.damping, 1)} %; exact on release`;
  painted(begin, "estimate");
}
// How long it took from the input until the map was painted.
function painted(begin, what) {
  requestAnimationFrame(() => setTimeout(() => {
    const ms = performance.now() - begin;
    seen.timing[`${what} ms`] = ms;
    document.body.dataset[what] = ms.toFixed(1);
    document.body.dataset[`${what}Count`] = +(document.body.dataset[`${what}Count`] ?? 0) + 1;
    seen.timing.text = `${what === "exact" ? "modes computed and drawn" : "estimate drawn"} within ${ms < 1000 ? `${ms.toFixed(0)} ms` : `${(ms / 1000).toFixed(1)} s`}`;
    tick();
  }, 0));
}

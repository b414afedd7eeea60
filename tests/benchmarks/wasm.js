"use strict";
// The converter's FMU as WebAssembly, at an infinite bus whose angle jumps: rows of p, q and frequency.
async function opened(bytes, given) {
  const made = await WebAssembly.compile(bytes), names = WebAssembly.Module.imports(made);
  const nothing = Object.fromEntries(names.map(one => [one.name, () => 0]));
  const { exports: fmu } = await WebAssembly.instantiate(made, { wasi_snapshot_preview1: nothing });
  if (fmu._initialize) fmu._initialize();
  const text = words => {
    const bytes = new TextEncoder().encode(`${words}\0`), place = fmu.malloc(bytes.length);
    new Uint8Array(fmu.memory.buffer).set(bytes, place);
    return place;
  };
  const name = text("converter"), guid = text(given.guid), which = fmu.malloc(16), value = fmu.malloc(16);
  const good = (status, what) => { if (status) throw new Error(`${what}: status ${status}`); };
  return (jump, values) => {
    const instance = fmu.fmi2Instantiate(name, 1, guid, 0, 0, 0, 0), view = () => new DataView(fmu.memory.buffer);
    if (!instance) throw new Error("no instance");
    const put = (key, x) => {
      view().setUint32(which, given.references[key], true);
      view().setFloat64(value, x, true);
      good(fmu.fmi2SetReal(instance, which, 1, value), key);
    };
    const get = key => {
      view().setUint32(which, given.references[key], true);
      good(fmu.fmi2GetReal(instance, which, 1, value), key);
      return view().getFloat64(value, true);
    };
    fmu.fmi2SetupExperiment(instance, 0, 0, 0, 0, 0);
    for (const [key, x] of Object.entries(values)) put(key, x);
    good(fmu.fmi2EnterInitializationMode(instance), "initialisation");
    put("v_re", 1); put("v_im", 0);
    good(fmu.fmi2ExitInitializationMode(instance), "initialisation");
    const rows = [];
    for (let k = 0; k < given.steps; k++) {
      if (k === given.at) { put("v_re", Math.cos(jump)); put("v_im", Math.sin(jump)); }
      good(fmu.fmi2DoStep(instance, k * given.step, given.step, 1), `step ${k}`);
      if (k % given.every === given.every - 1) rows.push([get("p"), get("q"), get("omega")]);
    }
    fmu.fmi2FreeInstance(instance);
    return rows;
  };
}

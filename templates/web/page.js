// A page in which a mechanism runs: the model in WebAssembly, and what moves it and its picture.

// Bytes of what is packed as text.
async function unpacked(text) {
  const packed = new Blob([Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0))]);
  return new Response(packed.stream().pipeThrough(new DecompressionStream("deflate"))).arrayBuffer();
}

const CLOSED = 1e-9; // scaled residual of loops that count as closed
const DECLARED = "as declared"; // of an input, whatever the model has
const ENERGIES = ["kinetic energy", "potential energy", "energy"];

// -- the model ------------------------------------------------------------------------------------------------------------

class Model {
  static async open(info, text) {
    const { instance } = await WebAssembly.instantiate(await unpacked(text), {});
    return new Model(info, instance.exports);
  }

  constructor(info, exports) {
    const { events, resets } = info, n = info.x.length;
    this.info = info;
    this.f = exports;
    this.n = n;
    exports._initialize?.();
    const column = (rows, k) => this.integers(rows.map((row) => row[k]));
    exports.web_open(
      info.q.length, info.slots.length, this.integers(info.slots.flat()), events.length, column(events, 1),
      column(events, 2), column(events, 3), resets.length, column(resets, 0), column(resets, 1),
    );
    this.spare = { x: this.room(3 * n + 64), p: this.room(info.p.length), mask: this.room(n), atol: this.room(n) };
    this.kernels = Object.fromEntries(info.kernels.map(([name, size], k) => [name, [k, size, this.room(size)]]));
    this.setParameters(info.pValues);
    exports.web_scales();
    this.inputs = [];
    info.u.forEach((_, k) => this.setInput(k, DECLARED));
    this.write(this.spare.atol, info.atol);
    [this.method, this.stepSize] = [info.method, info.step];
  }

  room(count) { return this.f.web_room(8 * Math.max(count, 1)); }
  write(at, values) { new Float64Array(this.f.memory.buffer, at, values.length).set(values); }
  read(at, count) { return new Float64Array(this.f.memory.buffer, at, count).slice(); }

  integers(values) {
    const at = this.f.web_room(4 * values.length + 4);
    new Int32Array(this.f.memory.buffer, at, values.length).set(values);
    return at;
  }

  setParameters(p) {
    this.p = [...p];
    this.write(this.spare.p, p);
    return this.f.web_set(this.spare.p) === 0;
  }

  // An input: a number, an expression, or as the model declares it.
  setInput(k, given) {
    const { info } = this, known = info.signals[k], value = given === DECLARED && !known ? info.uValues[k] : given;
    if (typeof value !== "number") this.setTape(k, ...(value === DECLARED ? known.slice(1) : parseExpression(value, info)));
    else {
      this.f.web_signal(k, 0, 0, 0, 0);
      new Float64Array(this.f.memory.buffer, this.f.web_inputs(), info.u.length)[k] = value;
    }
    this.inputs[k] = value;
  }

  setTape(k, code, constants, last) {
    const numbers = this.room(constants.length);
    this.write(numbers, constants);
    this.f.web_signal(k, code.length, this.integers(code.flat()), numbers, last);
  }

  // Values of a function of the model at a time and a state; null where it has none. Parts of outputs may be NaN.
  call(name, t, x) {
    if (!(name in this.kernels)) return null;
    const [k, size, out] = this.kernels[name], parts = name === "outputs";
    this.write(this.spare.x, x);
    if (parts) this.write(out, new Float64Array(size).fill(NaN));
    this.f.web_force(t, this.spare.x);
    return this.f.web_call(k, t, this.spare.x, out) === 0 || parts ? this.read(out, size) : null;
  }

  mask(held) {
    new Int32Array(this.f.memory.buffer, this.spare.mask, this.n).set(this.info.v.map((_, k) => +held.includes(k)));
    return this.spare.mask;
  }

  // The state with loops closed near x, where velocities that are held keep coordinates and values; null if there is none.
  close(t, x, held) {
    this.write(this.spare.x, x);
    const mask = this.mask(held);
    if (!(this.f.web_close(t, this.spare.x, mask) <= CLOSED)) return null;
    const beyond = this.f.web_close_rates(t, this.spare.x, mask);
    const found = this.read(this.spare.x, this.n);
    const aligned = this.call("alignment", t, found);
    if (aligned && aligned.some((part) => part <= 0)) return null;
    return beyond <= 1e-7 ? found : this.call("project", t, found);
  }

  // From a closed state to other parameters and coordinates, in steps that stay on its branch: [state, parameters, whether
  // they are reached].
  reach(t, from, p, values) {
    const { info, p: first } = this, ways = p.map((value, k) => (value - first[k]) / (Math.abs(first[k]) || 1));
    for (const [k, value] of values) ways.push((value - from[k]) / (k < info.q.length ? info.sizes[k] : 1e9));
    const far = Math.max(0, ...ways.map(Math.abs)), count = info.rows ? Math.min(60, Math.max(1, Math.ceil(far / 0.05))) : 1;
    let x = from, last = first;
    if (!Number.isFinite(far)) return [x, last, false];
    for (let step = 1; step <= count; step += 1) {
      const part = step === count ? 1 : step / count, next = Float64Array.from(x);
      const between = (a, b) => (part === 1 ? b : a + part * (b - a));
      for (const [k, value] of values) next[k] = between(from[k], value);
      const here = p.map((value, k) => between(first[k], value));
      const closed = this.setParameters(here) ? (info.rows ? this.close(t, next, info.independent) : next) : null;
      if (!closed || !closed.every(Number.isFinite)) {
        this.setParameters(last);
        return [x, last, false];
      }
      x = closed;
      last = here;
    }
    return [x, last, true];
  }

  // Bring a point of a body towards a place seen along axes; null where loops would open.
  pull(t, x, body, local, axes, target, size) {
    const at = this.spare.x + 8 * this.n, put = [...local, ...axes, ...target];
    let now = x;
    for (let k = 0; k < 4; k += 1) {
      this.write(this.spare.x, now);
      this.write(at, put);
      const count = target.length, mask = this.mask([]);
      if (this.f.web_pull(t, this.spare.x, mask, body, at, at + 24, count, at + 24 + 8 * axes.length, size)) return null;
      if (this.info.rows && !(this.f.web_close(t, this.spare.x, mask) <= CLOSED)) return null;
      now = this.read(this.spare.x, this.n);
    }
    return this.info.rows ? this.close(t, now, this.info.independent) : now;
  }

  // A run by a method of info.methods: the first watches its steps, those of the others are of one size.
  begin(t, x) {
    const { info, method, spare } = this, { stepSize = 0 } = method > 0 ? this : {};
    this.write(spare.x, x);
    this.f.web_begin(
      t, spare.x, info.rtol, spare.atol, stepSize || (info.maxStep ?? Infinity), stepSize || (info.firstStep ?? 0), info.end, method,
    );
    this.ended = "";
    this.happened = [];
  }

  // Steps up to a time, for some milliseconds at most; whether it is reached.
  advance(target, most = Infinity) {
    const begun = performance.now();
    while (!this.ended) {
      const status = this.f.web_advance(target, 8), width = 2 + this.n;
      for (let k = 0; k < this.f.web_noted(); k += 1) {
        const [event, t] = this.read(this.f.web_notes() + 8 * width * k, 2);
        this.happened.push([this.info.events[event][0], t]);
      }
      if (status === 1) return true;
      if (status !== 0) this.ended = this.why(status / 10);
      if (performance.now() - begun > most) return false;
    }
    return false;
  }

  why(status) {
    const t = this.f.web_time().toPrecision(5);
    if (status === 2) return `an event ended the run at t = ${t} s`;
    if (status === -102) return `events follow each other ever faster at t = ${t} s`;
    if (status === -103) return `the state after an event at t = ${t} s cannot be closed`;
    const reasons = ["its steps became too small", "a value is not finite", "the mass matrix is singular",
      "the loops cannot be closed", "the independent coordinates cannot move the mechanism here",
      "the accelerations are not determined"];
    return `the run ends at t = ${t} s: ${reasons[this.f.web_failure()] ?? reasons[0]}`;
  }

  // The state at a time of the last step, on the constraints.
  state(t) {
    this.f.web_state(t, this.spare.x);
    const x = this.read(this.spare.x, this.n);
    return this.call("project", t, x) ?? x;
  }

  residual(t, x) {
    const rows = this.call("constraints", t, x);
    return rows ? rows.reduce((most, row) => Math.max(most, Math.abs(row)), 0) : 0;
  }
}

// -- inputs as expressions of t -------------------------------------------------------------------------------------------

const FUNCTIONS = { min: 2, max: 2, atan2: 2, hypot: 2 }; // numbers that each takes, the first two or more
for (const name of "abs sign sqrt exp log sin cos tan asin acos atan sinh cosh tanh asinh acosh atanh".split(" ")) FUNCTIONS[name] = 1;

const INFIX = { "+": ["add", 1], "-": ["sub", 1], "*": ["mul", 2], "/": ["div", 2], "**": ["pow", 4] }; // how tight

// The instructions of a text such as 2*sin(3*t): [code, numbers, last], as the model plays them.
function parseExpression(text, names) {
  const code = [], numbers = [], words = text.match(/\d+\.?\d*(?:e[-+]?\d+)?|\.\d+(?:e[-+]?\d+)?|\w+|\*\*|\S/gi) ?? [];
  let at = 0;
  const emit = (name, a = 0, b = 0, c = 0) => code.push([names.operations.indexOf(name), a, b, c]) - 1;
  const take = (word) => words[at] === word && (at += 1);
  const fail = (why) => { throw new Error(`${why} in ${text}`); };
  function atom() {
    const word = words[at];
    at += 1;
    if (word === "-") return emit("neg", chain(3));
    if (word === "+") return chain(3);
    if (word === "(") return inside(1)[0];
    if (Number.isFinite(Number(word))) return emit("const", numbers.push(Number(word)) - 1);
    if (word === "t") return emit("t");
    if (word === "pi") return emit("const", numbers.push(Math.PI) - 1);
    for (const kind of ["x", "p"]) if (names[kind].includes(word)) return emit(kind, names[kind].indexOf(word));
    if (!Object.hasOwn(FUNCTIONS, word) || !take("(")) fail(`${word ?? "the end"} is not known`);
    const given = inside(Infinity), count = FUNCTIONS[word], more = ["min", "max"].includes(word);
    if (given.length < count || (given.length > count && !more)) fail(`${word}() takes ${count}${more ? " or more" : ""}, not ${given.length}`);
    return given.length > 1 && more ? given.reduce((a, b) => emit(word, a, b)) : emit(word, ...given);
  }
  function inside(most) {
    const found = [chain(1)];
    while (found.length < most && take(",")) found.push(chain(1));
    if (!take(")")) fail(") is missing");
    return found;
  }
  function chain(least) {
    let found = atom();
    while (Object.hasOwn(INFIX, words[at] ?? "") && INFIX[words[at]][1] >= least) {
      const [name, own] = INFIX[words[at]];
      at += 1;
      found = emit(name, found, chain(own === 4 ? 3 : own + 1));
    }
    return found;
  }
  const last = chain(1);
  if (at < words.length) fail(`${words[at]} is not expected`);
  return [code, numbers, last];
}

// -- the page -------------------------------------------------------------------------------------------------------------

const get = (id) => document.getElementById(id);
function shown(value, digits = 4) {
  if (!Number.isFinite(value)) return "-";
  const plain = Number(value.toPrecision(digits)), size = Math.abs(plain);
  return size === 0 || (size >= 1e-3 && size < 1e5) ? String(plain) : value.toExponential(digits - 1).replace(/\.?0*e\+?/, "e");
}

function element(kind, parent, properties = {}) {
  const made = document.createElement(kind);
  Object.assign(made, properties);
  parent.append(made);
  return made;
}

class Page {
  constructor(data, numbers, model) {
    const dark = matchMedia("(prefers-color-scheme: dark)").matches;
    Object.assign(this, { data, model, numbers, dark, frames: [], cursor: 0, playing: true, count: 0, last: null });
    this.picture = new Picture(data, numbers, get("picture"), get("over"));
    this.names = data.labels.length > 0;
    if (!this.picture.gl) {
      this.say("This page needs WebGL 2, which this browser does not offer here. Switch on hardware acceleration, open the page in another browser, or write the animation as .gif.");
      return;
    }
    this.columns = model ? [...model.info.x, ...model.info.y, ...ENERGIES, "loop residual"] : data.curves.map((one) => one.name);
    this.fill();
    this.listen();
    if (!model) this.frames = data.motion.t.map((t, k) => ({ t, clock: data.motion.clock[k] }));
    else {
      this.start = Float64Array.from(model.info.x0);
      this.recorded(data.motion);
      if (!this.replayed) this.restart();
    }
    requestAnimationFrame((stamp) => this.step(stamp));
  }

  say(text) {
    get("message").textContent = text;
    get("message").hidden = !text;
  }

  // -- states over time --

  recorded(motion) {
    const { model, numbers } = this;
    motion?.t.forEach((t, k) => {
      const x = new Float64Array(numbers.subarray(motion.states + k * model.n, motion.states + (k + 1) * model.n));
      this.keep(t, model.call("project", t, x) ?? x);
    });
    this.most = [0, 0];
    this.replayed = this.frames.length > 0;
  }

  keep(t, x) {
    const { model } = this, [T, V] = model.call("energy", t, x) ?? [NaN, NaN], { length } = model.info.y;
    const outputs = length ? model.call("outputs", t, x).subarray(0, length) : [];
    this.frames.push({ t, clock: t, x, row: [...x, ...outputs, T, V, T + V, model.residual(t, x)] });
    if (this.frames.length > 20000) this.frames.splice(0, 5000);
  }

  // Begin anew from a start.
  restart(x = this.start, words = "") {
    const open = this.model.residual(0, x);
    Object.assign(this, { start: x, frames: [], cursor: 0, event: "", most: [0, 0] });
    this.say(words || open <= 1e-6 ? words : `the loops are open at the start, by ${shown(open)}`);
    this.keep(0, x);
    this.goOn();
  }

  // What is shown from here on begins at the state shown.
  goOn() {
    const at = this.frames[this.cursor];
    this.frames.length = this.cursor + 1;
    this.replayed = false;
    this.model.begin(at.t, at.x);
  }

  step(stamp) {
    requestAnimationFrame((next) => this.step(next));
    const passed = this.last === null ? 0 : Math.min(0.1, (stamp - this.last) / 1000) * get("speed").value;
    this.last = stamp;
    try {
      if (this.playing && passed > 0) this.proceed(passed);
      this.show();
    } catch (error) {
      this.play(false);
      this.say(`the run stops here: ${error.message}; reset begins anew`);
    }
    this.count += 1;
  }

  proceed(passed) {
    const { frames, model } = this, now = this.clock ?? frames[this.cursor].clock, next = now + passed;
    this.clock = next;
    if (this.cursor + 1 < frames.length) {
      while (this.cursor + 1 < frames.length && frames[this.cursor + 1].clock <= next) this.cursor += 1;
      return;
    }
    if (!model || this.replayed) { // a film begins again
      this.cursor = 0;
      this.clock = frames[0].clock;
      return;
    }
    const { end } = model.info, stops = now < end && next >= end; // the declared run; play goes on
    const begun = performance.now(), count = Math.ceil((passed * 60) / get("speed").value);
    for (let k = 1; k <= count; k += 1) { // no coarser than the eye sees, however slowly pages are drawn
      const wanted = stops && k === count ? end : now + ((stops ? end - now : passed) * k) / count;
      const reached = model.advance(wanted, 14), t = reached ? wanted : model.f.web_time();
      if (model.ended && t <= frames.at(-1).t) {
        this.play(false);
        this.say(model.ended);
        break;
      }
      this.keep(t, model.state(t));
      this.cursor = frames.length - 1;
      this.clock = t;
      this.slow = !reached || performance.now() - begun > 60;
      if (this.slow) break;
    }
    if (this.clock === end) this.play(false);
    for (const [name, time] of model.happened.splice(0)) this.event = `${name} at ${shown(time)} s`;
  }

  play(on) {
    this.playing = on;
    this.clock = undefined;
    get("play").textContent = on ? "\u275a\u275a" : "\u25b6";
  }

  move(by) {
    this.play(false);
    if (this.model && !this.replayed && this.cursor + by >= this.frames.length) {
      this.proceed(get("speed").value / 60);
      this.clock = undefined;
    } else this.cursor = Math.min(this.frames.length - 1, Math.max(0, this.cursor + by));
  }

  poses(k = this.cursor) {
    const { model, data, numbers } = this, { t, x } = this.frames[k], { poses, bodies } = { ...data.motion, ...data };
    const all = model?.call("poses", t, x), at = poses + 12 * bodies.length * k;
    if (model && !all) return this.picture.poses;
    const found = bodies.map((_, body) => all ? all.subarray(16 * body, 16 * body + 16)
      : [...numbers.subarray(at + 12 * body, at + 12 * body + 12), 0, 0, 0, 1]);
    found[-1] = IDENTITY;
    return found;
  }

  show() {
    const { model, picture, data, cursor } = this, frame = this.frames[cursor], poses = this.poses(), time = get("time");
    this.follow(get("trace").value);
    this.point(frame);
    picture.draw(poses, cursor, this.dark, this.names);
    if (this.changed) this.fit(false);
    time.max = this.frames.length - 1;
    time.value = cursor;
    const words = model ? `t = ${frame.t.toFixed(2)} s` : data.motion.words[cursor];
    const pace = model && this.playing && this.slow ? "  slower than real time" : "";
    get("words").textContent = words + pace + (this.event ? `  ${this.event}` : "");
    if (this.count % 3 === 0 || !this.playing) for (const k of [1, 2]) this.plot(get(`plot${k}`), get(`choice${k}`).value);
    if (model && this.count % 6 === 0) this.measure(frame);
  }

  // The view on the run so far, or on all of a film; after a change, wider where the mechanism leaves the view.
  fit(anew) {
    const { picture, data, model, frames } = this, every = anew ? Math.ceil(frames.length / 40) : Infinity;
    const some = [...frames.keys()].filter((k) => k % every === 0 || k === this.cursor);
    const { low, high } = model ? picture.extent(some.map((k) => this.poses(k))) : data, old = anew ? { low, high } : picture;
    const margin = 0.1 * Math.max(...old.high.map((x, k) => x - old.low[k]));
    const inside = low.every((x, k) => x >= old.low[k] - margin && high[k] <= old.high[k] + margin);
    this.changed = false;
    if (!(low[0] <= high[0]) || (!anew && inside)) return;
    picture.low = low.map((x, k) => Math.min(x, old.low[k]));
    picture.high = high.map((x, k) => Math.max(x, old.high[k]));
    picture.fit();
  }

  // The way of a marker, through all frames since it was last drawn.
  follow(name) {
    const { trace, points } = this.picture, [, body, shape] = this.data.markers.find((one) => one[0] === name) ?? [];
    if (this.traced !== name || this.cursor < this.tracedAt) {
      trace.points = [];
      this.tracedAt = this.cursor - 1;
    }
    this.traced = name;
    if (!name) return;
    const found = [];
    while (this.tracedAt < this.cursor) found.push(...place(this.poses(this.tracedAt += 1)[body], points[shape]));
    if (found.length) trace.points = [...trace.points.slice(-9000), ...found];
  }

  // Arrows of the forces and reactions that are asked for, now.
  point({ t, x }) {
    const { model, most } = this, wanted = get("arrows").value, { arrows = [], y } = model?.info ?? {};
    const values = wanted && model ? model.call("outputs", t, x).subarray(y.length) : [];
    const chosen = (k) => wanted === "both" || arrows[Math.floor(k / 6)][1] === (wanted === "reactions");
    this.picture.point(wanted ? arrows : [], values.map((value, k) => (chosen(k) ? value : NaN)), most);
    const [force, moment] = most ?? [], longest = [force > 0 && `${shown(force, 3)} N`, moment > 0 && `${shown(moment, 3)} N m`];
    get("scale").textContent = wanted ? `longest arrow ${longest.filter(Boolean).join(", ")}` : "";
  }

  measure(frame) {
    for (const [k, field] of Object.entries(this.fields)) {
      if (![field.box, field.slide].includes(document.activeElement)) this.put(field, frame.x[k]);
    }
    if (this.model.info.rows) get("residual").textContent = `loop residual ${this.model.residual(frame.t, frame.x).toExponential(1)}`;
  }

  // -- curves --

  plot(canvas, choice) {
    const { model, cursor, frames, data } = this, pen = canvas.getContext("2d"), ratio = window.devicePixelRatio || 1;
    const { clientWidth: wide, clientHeight: tall } = canvas, scrolls = model && !this.replayed, last = scrolls ? cursor + 1 : Infinity;
    if (wide < 10) return;
    [canvas.width, canvas.height] = [wide * ratio, tall * ratio];
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    const part = frames.slice(scrolls ? Math.max(0, cursor - 1200) : 0, last);
    const rows = (choice === "energies" ? ENERGIES : [choice]).map((name) => this.columns.indexOf(name));
    const over = model ? part.map((frame) => frame.t) : data.curves[rows[0]].over;
    const lines = rows.map((k) => (model ? part.map((frame) => frame.row[k]) : data.curves[k].values));
    const values = lines.flat().filter(Number.isFinite);
    if (!values.length) return;
    let low = Math.min(...values), high = Math.max(...values);
    if (high - low < 1e-6 * Math.max(1e-3, Math.abs(high))) { low -= 0.5 * (Math.abs(low) || 1); high += 0.5 * (Math.abs(high) || 1); }
    const span = over.at(-1) - over[0] || 1, X = (t) => 52 + ((wide - 60) * (t - over[0])) / span;
    const Y = (v) => tall - 18 - ((tall - 26) * (v - low)) / (high - low);
    const write = (text, x, y, align, color = this.dark ? "#e6e6e6" : "#222222") => {
      [pen.textAlign, pen.fillStyle] = [align, color];
      pen.fillText(text, x, y);
    };
    pen.font = "11px system-ui, sans-serif";
    for (const v of [low, high]) write(shown(v, 3), 48, Math.min(tall - 16, Math.max(10, Y(v) + 3)), "right");
    write(shown(over.at(-1), 3), wide - 6, tall - 4, "right");
    write(shown(over[0], 3), 52, tall - 4, "left");
    pen.lineWidth = 1.6;
    lines.forEach((line, j) => {
      pen.strokeStyle = ["#0072B2", "#D55E00", "#009E73"][j];
      pen.beginPath();
      line.forEach((v, i) => pen.lineTo(X(over[i]), Y(v)));
      pen.stroke();
      if (lines.length > 1) write(["T", "V", "T + V"][j], 120 + 34 * j, tall - 4, "left", pen.strokeStyle);
    });
    pen.fillRect(X(model ? frames[cursor].t : data.motion.over[cursor]), 4, 1, tall - 20);
  }

  // -- controls --

  fill() {
    const { data, model } = this, columns = [...this.columns], units = { ...data.units };
    const option = (list, value, text = value) => element("option", get(list), { value, textContent: text });
    for (const name of [...ENERGIES, "energies"]) units[name] = "J";
    const label = (name) => (units[name] ? `${name} (${units[name]})` : name);
    if (model && "energy" in model.kernels) columns.splice(0, 0, "energies");
    for (const name of columns) for (const k of [1, 2]) option(`choice${k}`, name, label(name));
    if (columns.length > 1) [get("choice1").value, get("choice2").value] = columns[0] === "energies" ? [columns[1], columns[0]] : columns;
    get("plots").hidden = !columns.length;
    get("side").hidden = !model && !columns.length && !get("equations");
    for (const factor of [0.1, 0.25, 0.5, 1, 2, 4]) option("speed", factor, `\u00d7${shown(factor * (model ? 1 : data.motion.pace), 2)}`);
    get("speed").value = 1;
    get("named").hidden = !data.labels.length;
    for (const id of ["trace", "arrows", "branch", "method"]) get(id).parentElement.hidden = true;
    if (!model) return;
    const { info } = model, { docs, ranges } = info, home = info.q.length;
    const offer = (list, entries, least) => {
      entries.forEach(([value, text]) => option(list, value, text));
      get(list).parentElement.hidden = entries.length < least;
    };
    offer("trace", data.markers.map(([name]) => [name, name]), 1);
    offer("branch", info.branches.map((_, k) => [k, `assembly ${k + 1}`]), 2);
    offer("method", info.methods.map((name, k) => [k, name]), 1);
    get("arrows").parentElement.hidden = !info.arrows.length;
    get("method").value = model.method;
    get("size").value = model.stepSize;
    this.fields = {};
    for (const k of [...info.independentQ, ...info.independent.map((j) => home + j)]) {
      const speed = Math.max(10, 2 * Math.abs(info.x0[k])), range = k < home ? ranges[info.x[k]] : [-speed, speed];
      this.fields[k] = this.field("starts", label(info.x[k]), info.x0[k], range, (value) => this.setStart(k, value));
    }
    const several = (id, names, values, set) => names.map((name, k) => (
      this.field(id, label(name), values[k], ranges[name], (value) => set(k, value), docs[name])));
    this.settings = several("parameters", info.p, info.pValues, (k, value) => this.setParameter(k, value));
    this.forces = several("inputs", info.u, model.inputs, (k, value) => this.setInput(k, value));
    for (const id of ["parameters", "inputs", "starts"]) get(id).parentElement.hidden = !get(id).children.length;
    get("copying").hidden = get("reset").hidden = false;
  }

  // A slider and a box for one value; typed values widen the slider.
  field(home, text, value, [low, high], set, about = "") {
    const row = element("label", get(home), { className: "field", title: about });
    element("span", row, { textContent: text });
    const slide = element("input", row, { type: "range", min: low, max: high, step: (high - low) / 500 || 1, value: 0 });
    const box = element("input", row, { inputMode: "text", ariaLabel: text }), made = { slide, box };
    this.put(made, value);
    slide.oninput = () => { this.put(made, Number(slide.value)); set(Number(slide.value)); };
    box.onchange = () => {
      const typed = box.value.trim(), entered = typed ? Number(typed) : NaN, words = home === "inputs" && typed && Number.isNaN(entered);
      if (!words && !Number.isFinite(entered)) { this.settle(); this.say(`${text} must be a finite number, not ${typed || "nothing"}`); return; }
      if (!words) [slide.min, slide.max] = [Math.min(slide.min, entered), Math.max(slide.max, entered)];
      if (!words) slide.value = entered;
      set(words ? typed : entered);
    };
    return made;
  }

  put({ slide, box }, value) {
    box.value = typeof value === "number" ? shown(value, 6) : value;
    if (typeof value === "number") slide.value = value;
  }

  // Another parameter: the state shown and the start go along; where loops cannot close, both stay.
  setParameter(k, value) {
    const { model } = this, { info, p: before } = model, low = info.bounds[info.p[k]], now = this.frames[this.cursor];
    if (low && !(value >= low[0] && value <= low[1])) {
      this.settle();
      this.say(`${info.p[k]} must be from ${shown(low[0])} to ${shown(low[1])}`);
      return;
    }
    const [x, p, reached] = model.reach(now.t, now.x, before.map((old, i) => (i === k ? value : old)), []);
    model.setParameters(before);
    const [first, , whole] = model.reach(0, this.start, p, []);
    model.setParameters(p);
    this.start = whole ? first : model.close(0, x, info.independent) ?? x;
    this.settle();
    this.replace(now.t, x);
    this.say(!reached ? `the loops do not close with ${info.p[k]} = ${shown(value)}; the mechanism is shown with ${shown(p[k])}`
      : whole ? "" : `the loops do not close at the start with ${info.p[k]} = ${shown(value)}; what is shown is the start from now on`);
  }

  // The parameters that the model has, into the picture and the boxes.
  settle() {
    const { p, info } = this.model;
    this.picture.change(Object.fromEntries(info.p.map((name, k) => [name, p[k]])));
    this.changed = true;
    this.settings.forEach((field, k) => this.put(field, p[k]));
  }

  // Parameters, inputs and start as the model declares them.
  declare() {
    const { model } = this, { info } = model;
    model.setParameters(info.pValues);
    this.forces.forEach((_, k) => this.setInput(k, DECLARED));
    this.settle();
    this.restart(Float64Array.from(info.x0));
  }

  replace(t, x) {
    this.frames.length = this.cursor;
    this.keep(t, x);
    this.goOn();
  }

  // A coordinate or velocity to begin with.
  setStart(k, value) {
    const { model } = this, [x, , reached] = model.reach(0, this.frames[this.cursor].x, model.p, [[k, value]]);
    this.play(false);
    this.restart(x, reached ? "" : `the loops do not close there; the picture shows ${model.info.x[k]} = ${shown(x[k])}`);
  }

  setInput(k, value) {
    const { model } = this;
    try {
      model.setInput(k, value);
    } catch (error) {
      this.say(error.message);
      return;
    }
    this.put(this.forces[k], model.inputs[k]);
    this.say("");
    this.goOn();
  }

  setBranch(k) {
    const { model } = this, x = Float64Array.from(model.info.x0), p = model.p;
    x.set(model.info.branches[k]);
    model.setParameters(model.info.pValues);
    const [closed, , reached] = model.reach(0, model.close(0, x, model.info.independent) ?? x, p, []);
    this.settle();
    this.restart(closed, reached ? "" : "these loops do not close with the parameters set; the boxes show those that they close with");
  }

  // How the run goes on: by watched steps, or by steps of one size.
  setMethod() {
    const { model } = this, size = Number(get("size").value);
    model.method = Number(get("method").value);
    get("size").parentElement.hidden = model.method === 0;
    if (size > 0 && size < Infinity) model.stepSize = size;
    else this.say("the step must be a finite positive number of seconds");
    get("size").value = model.stepSize;
    this.goOn();
  }

  reset() {
    if (this.model) this.restart();
    else this.cursor = 0;
    this.clock = undefined;
  }

  copy(kind) {
    const { model, start } = this, { info, method, stepSize } = model, number = (x) => String(Number(x.toPrecision(15)));
    const value = (x) => (typeof x === "number" ? number(x) : JSON.stringify(x)), python = kind === "python";
    const places = [...info.independentQ, ...info.independent.map((j) => info.q.length + j)];
    const initial = places.map((k) => [info.x[k], number(start[k])]), parameters = info.p.map((name, k) => [name, number(model.p[k])]);
    const changed = info.u.map((name, k) => [name, model.inputs[k]]).filter(([, input]) => input !== DECLARED);
    const inputs = changed.map(([name, x]) => [name, python ? value(x) : `{${typeof x === "number" ? "value" : "signal"}: ${value(x)}}`]);
    const set = (pairs) => `{${pairs.map(([name, x]) => `${python ? JSON.stringify(name) : name}: ${x}`).join(", ")}}`;
    const how = method === 1 ? [["method", python ? '"RK4"' : "RK4"], ["step", stepSize]] : []; // simulate has no other
    const run = [`mod.simulate(${number(info.end)}`, `initial=${set(initial)}`, `parameters=${set(parameters)}`, `inputs=${set(inputs)}`];
    const entries = [["parameters", parameters], ["inputs", inputs], ["initial", initial], ["simulation", how.length ? [["end", info.end], ...how] : []]];
    const box = get("copied");
    box.value = python ? `run = ${[...run, ...how.map(([name, x]) => `${name}=${x}`)].join(",\n    ")})`
      : entries.filter(([, pairs]) => pairs.length).map(([name, pairs]) => `${name}: ${set(pairs)}`).join("\n");
    box.hidden = false;
    box.select();
    navigator.clipboard?.writeText(box.value).catch(() => {});
  }

  listen() {
    const canvas = get("over"), fingers = new Map(), fit = () => this.fit(true), click = (id, act) => { get(id).onclick = act; };
    get("picture").addEventListener("webglcontextlost", (event) => {
      event.preventDefault();
      this.say("the browser took the picture's memory; it is drawn again when the browser allows, else reload the page");
    });
    get("picture").addEventListener("webglcontextrestored", () => {
      this.picture = new Picture(this.data, this.numbers, get("picture"), canvas);
      this.traced = undefined;
      if (this.model) this.settle();
      this.say("");
    });
    const light = () => { document.documentElement.dataset.theme = this.dark ? "dark" : "light"; };
    light();
    click("declared", () => this.declare());
    click("play", () => this.play(!this.playing));
    click("back", () => this.move(-1));
    click("forth", () => this.move(1));
    click("reset", () => this.reset());
    click("theme", () => { this.dark = !this.dark; light(); });
    click("named", () => { this.names = !this.names; });
    click("python", () => this.copy("python"));
    click("yaml", () => this.copy("yaml"));
    get("time").oninput = () => { this.play(false); this.cursor = Number(get("time").value); };
    get("branch").onchange = () => this.setBranch(Number(get("branch").value));
    get("method").onchange = get("size").onchange = () => this.setMethod();
    const at = (event) => { const box = canvas.getBoundingClientRect(); return [event.clientX - box.left, event.clientY - box.top]; };
    canvas.onpointerdown = (event) => {
      canvas.setPointerCapture(event.pointerId);
      fingers.set(event.pointerId, at(event));
      this.grip = this.model && fingers.size === 1 && !event.shiftKey ? this.picture.pick(...at(event)) : null;
      if (this.grip) this.play(false);
    };
    canvas.onpointermove = (event) => {
      const before = fingers.get(event.pointerId), now = at(event);
      if (!before) return;
      const by = [now[0] - before[0], now[1] - before[1]], other = [...fingers].find(([id]) => id !== event.pointerId)?.[1];
      const apart = (point) => Math.hypot(point[0] - other[0], point[1] - other[1]) || 1;
      if (other) this.picture.zoom *= apart(now) / apart(before);
      else if (this.grip) this.drag(now);
      else if (this.data.view || event.shiftKey) this.pan(by);
      else this.orbit(by);
      fingers.set(event.pointerId, now);
    };
    canvas.onpointerup = canvas.onpointercancel = (event) => { fingers.delete(event.pointerId); this.grip = null; };
    canvas.onwheel = (event) => {
      event.preventDefault();
      this.picture.zoom = Math.min(50, Math.max(0.1, this.picture.zoom * Math.exp(-event.deltaY / 500)));
    };
    canvas.ondblclick = fit;
    const faster = (by) => { get("speed").selectedIndex = Math.min(5, Math.max(0, get("speed").selectedIndex + by)); };
    const keys = {
      " ": () => this.play(!this.playing), ArrowLeft: () => this.move(-1), ArrowRight: () => this.move(1), 0: fit,
      r: () => this.reset(), n: () => get("named").click(), "+": () => faster(1), "-": () => faster(-1),
    };
    document.onkeydown = (event) => {
      const { tagName, type } = event.target, kind = type === "range" ? type : tagName;
      const taken = { BUTTON: [" "], SUMMARY: [" "], range: ["ArrowLeft", "ArrowRight"], INPUT: keys, SELECT: keys, TEXTAREA: keys }[kind] ?? [];
      if (event.ctrlKey || event.metaKey || event.altKey || taken === keys || taken.includes(event.key) || !keys[event.key]) return;
      event.preventDefault();
      keys[event.key]();
    };
  }

  pan(by) {
    const { picture } = this, size = (2 * picture.half) / (picture.canvas.clientHeight || 1), { right, up } = picture.axes;
    picture.target = plus(plus(picture.target, right, -by[0] * size), up, by[1] * size);
  }

  orbit(by) {
    const { picture } = this, { up } = this.data, c = Math.cos(-by[0] / 150), s = Math.sin(-by[0] / 150), v = picture.toward;
    const about = plus(plus(scaled(v, c), cross(up, v), s), up, dot(up, v) * (1 - c));
    const lifted = unit(plus(about, unit(cross(about, cross(up, about))), by[1] / 150));
    picture.toward = Math.abs(dot(lifted, up)) < 0.99 ? lifted : about;
  }

  drag([x, y]) {
    const { picture, model, grip } = this, frame = this.frames[this.cursor], { right, up } = picture.axes;
    const here = place(picture.poses[grip.body], grip.local), seen = picture.seen(here);
    const size = ((2 * picture.half) / picture.canvas.clientHeight) * (this.data.view ? 1 : seen[3]);
    const target = plus(plus(here, right, (x - seen[0]) * size), up, (seen[1] - y) * size);
    const axes = [...right, ...up], reach = Math.max(...picture.high.map((h, k) => h - picture.low[k]));
    const moved = model.pull(0, frame.x, grip.body, grip.local, axes, [dot(right, target), dot(up, target)], reach);
    if (!moved || moved.some(Number.isNaN)) this.say("the loops do not close there");
    else this.restart(moved);
  }
}

if (typeof document === "undefined") globalThis.Model = Model;
else {
  const data = JSON.parse(get("data").textContent), say = Page.prototype.say;
  Promise.all([unpacked(data.numbers), data.wasm ? Model.open(data.model, data.wasm) : null])
    .then(([numbers, model]) => { window.page = new Page(data, new Float32Array(numbers), model); }).catch((error) => say(String(error)));
}

// Adds a clock, switches, names and curves to Meshcat's scene. Meshcat defines `viewer`
// and `MeshCat`. The function `replay_page` in Python writes the data `facts`.
"use strict";
(() => {
  const facts = JSON.parse(document.getElementById("replay-facts").textContent);
  const pane = document.getElementById("meshcat-pane");
  const $ = (selector) => document.querySelector(selector);
  const make = (tag, attributes = {}, ...inner) => {
    const svg = ["svg", "g", "path", "line", "text", "circle"].includes(tag);
    const element = svg
      ? document.createElementNS("http://www.w3.org/2000/svg", tag)
      : document.createElement(tag);
    for (const [key, value] of Object.entries(attributes))
      element.setAttribute(key, value);
    element.append(...inner);
    return element;
  };
  const node = (path) => viewer.scene_tree.find(["drake", ...path.split("/")]);

  // Clock ------------------------------------------------------------------
  const [play, slider, clock, speed] =
    ["#play", "#time", "#clock", "#speed"].map($);
  let time = 0, playing = false, ready = false, before = 0, view = "all";
  const charts = [];

  function show() {
    viewer.animator.seek(time);
    slider.value = time;
    slider.setAttribute("aria-valuetext", `${time.toFixed(1)} s`);
    clock.textContent = `${time.toFixed(2)} / ${facts.end_s.toFixed(2)} s`;
    charts.forEach((chart) => chart.cursor());
    if (view !== "all" && view !== "above") follow();
    placeNames();
  }
  function seek(to) {
    time = Math.min(Math.max(Number(to) || 0, 0), facts.end_s);
    if (ready) show();
  }
  function setPlaying(on) {
    playing = on && ready;
    if (playing && time >= facts.end_s) seek(0);
    before = performance.now();
    play.textContent = playing ? "❚❚ Pause" : "▶ Play";
  }
  function tick(now) {
    if (playing) {
      seek(time + (now - before) / 1000 * Number(speed.value));
      if (time >= facts.end_s) setPlaying(false);
    }
    before = now;
    requestAnimationFrame(tick);
  }
  play.addEventListener("click", () => setPlaying(!playing));
  $("#restart").addEventListener("click", () => seek(0));
  slider.addEventListener("input", () => { setPlaying(false); seek(slider.value); });
  addEventListener("keydown", (event) => {
    if (event.key !== " " || event.target.closest("button, select, input")) return;
    event.preventDefault();
    setPlaying(!playing);
  });

  // Viewport ---------------------------------------------------------------
  const THREE = MeshCat.THREE;
  // Converts a point in W to the frame of three.js, in which y is up.
  const screen = (x, y, z) => new THREE.Vector3(x, z, -y);
  const [xLow, xHigh, yLow, yHigh] = facts.bounds_m;
  const corners = [xLow, xHigh].flatMap((x) => [yLow, yHigh].flatMap(
    (y) => [0, 0.35].map((z) => screen(x, y, z))));
  const middle = screen((xLow + xHigh) / 2, (yLow + yHigh) / 2, 0);
  let offset = new THREE.Vector3();

  function look(target, from) {
    viewer.controls.target.copy(target);
    viewer.camera.position.copy(target).add(from);
    viewer.camera.lookAt(target);
    viewer.camera.updateMatrixWorld();
    viewer.controls.update();
    viewer.set_dirty();
  }
  // Places the camera in a direction from the middle of the floor, at the least distance
  // from which every corner is in view.
  function fit(direction) {
    let near = 0.5, far = 90;
    for (let k = 0; k < 40; k++) {
      const distance = (near + far) / 2;
      look(middle, direction.clone().multiplyScalar(distance));
      const seen = corners.every((corner) => {
        const p = corner.clone().project(viewer.camera);
        return Math.abs(p.x) < 0.96 && Math.abs(p.y) < 0.96 && p.z < 1;
      });
      if (seen) far = distance; else near = distance;
    }
    look(middle, direction.clone().multiplyScalar(far));
  }
  const slanted = new THREE.Vector3(0, 0.82, 0.57).normalize();
  const upright = new THREE.Vector3(0, 1, 0.001).normalize();
  function where(path) {
    return new THREE.Vector3().setFromMatrixPosition(node(path).object.matrixWorld);
  }
  function follow() {
    viewer.scene.updateMatrixWorld();
    offset.copy(viewer.camera.position).sub(viewer.controls.target);
    look(where(view), offset);
  }
  function setView(to) {
    view = to;
    if (to === "all") fit(slanted);
    else if (to === "above") fit(upright);
    else { look(where(to), slanted.clone().multiplyScalar(3)); follow(); }
    placeNames();
  }
  function zoom(factor) {
    offset.copy(viewer.camera.position).sub(viewer.controls.target);
    look(viewer.controls.target.clone(), offset.multiplyScalar(factor));
    placeNames();
  }
  $("#view").addEventListener("change", (event) => setView(event.target.value));
  $("#nearer").addEventListener("click", () => zoom(0.8));
  $("#farther").addEventListener("click", () => zoom(1.25));

  // Names ------------------------------------------------------------------
  const names = facts.names.map(([path, text, ...place]) => {
    const label = make("span", { class: "name", style: "display: none" }, text);
    pane.append(label);
    return { path, label, place };
  });
  function placeNames() {
    if (!ready) return;
    viewer.scene.updateMatrixWorld();
    for (const { path, label, place } of names) {
      const p = new THREE.Vector3(...place, 0)
        .applyMatrix4(node(path).object.matrixWorld)
        .add(screen(0, 0, 0.6)).project(viewer.camera);
      const x = (p.x + 1) / 2 * pane.clientWidth, y = (1 - p.y) / 2 * pane.clientHeight;
      const inside = p.z < 1 && x > 0 && y > 12 && x < pane.clientWidth &&
        y < pane.clientHeight;
      label.style.display = inside && namesOn ? "" : "none";
      label.style.transform = `translate(${x}px, ${y}px) translate(-50%, -100%)`;
    }
  }
  let namesOn = true;

  // Switches ---------------------------------------------------------------
  // Uses the layers of three.js to hide objects, because the recording itself changes
  // their property "visible".
  function setLayer(paths, on) {
    for (const path of paths)
      node(path).object.traverse((part) => part.layers.set(on ? 0 : 1));
    viewer.set_dirty();
  }
  document.querySelectorAll("aside input").forEach((box) => {
    const apply = () => {
      if (box.dataset.paths) setLayer(JSON.parse(box.dataset.paths), box.checked);
      else { namesOn = box.checked; placeNames(); }
    };
    box.addEventListener("change", () => ready && apply());
    box.apply = apply;
  });

  // Curves over time -------------------------------------------------------
  const LEFT = 44, RIGHT = 8, TOP = 6, BELOW = 20;
  function ticks(low, high, most) {
    const raw = (high - low) / most, power = 10 ** Math.floor(Math.log10(raw));
    const step = [1, 2, 5, 10].map((k) => k * power).find((s) => s >= raw);
    const found = [];
    for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++)
      found.push(Number((k * step).toPrecision(6)));
    return found;
  }
  function curve(series, x, y) {
    if (series.style === "dots")
      return series.t.map((t, k) => `M${x(t)} ${y(series.values[k])}h0`).join("");
    let path = "", pen = "M";
    series.t.forEach((t, k) => {
      if (series.values[k] === null) { pen = "M"; return; }
      const steps = series.style === "steps" && pen === "L";
      path += steps ? `H${x(t)}V${y(series.values[k])}`
        : `${pen}${x(t)} ${y(series.values[k])}`;
      pen = "L";
    });
    return path;
  }
  function reading(series, rows) {
    let k = series.t.findIndex((t) => t > time + 1e-9);
    k = (k < 0 ? series.t.length : k) - 1;
    const value = series.values[Math.max(k, 0)];
    if (k < 0 || value === null || value === undefined) return "–";
    const named = rows && rows.find(([row]) => row === value);
    return named ? named[1] : value.toFixed(2).replace("-", "−");
  }
  class Chart {
    constructor(box, first) {
      this.svg = box.querySelector("svg");
      this.readings = box.querySelector(".readings");
      this.select = box.querySelector("select");
      this.select.value = Math.min(first, facts.charts.length - 1);
      this.select.addEventListener("change", () => this.draw());
      const seekHere = (event) => {
        const left = this.svg.getBoundingClientRect().left;
        const part = (event.clientX - left - LEFT) / (this.width - LEFT - RIGHT);
        setPlaying(false);
        seek(part * facts.end_s);
      };
      this.svg.addEventListener("pointerdown", (event) => {
        this.svg.setPointerCapture(event.pointerId);
        seekHere(event);
      });
      this.svg.addEventListener("pointermove", (event) => {
        if (event.buttons) seekHere(event);
      });
      new ResizeObserver(() => this.draw()).observe(this.svg);
    }
    x(t) { return LEFT + t / (facts.end_s || 1) * (this.width - LEFT - RIGHT); }
    draw() {
      const chart = facts.charts[Number(this.select.value)];
      this.width = this.svg.clientWidth;
      const height = this.svg.clientHeight;
      if (!this.width) return;
      const [low, high] = chart.limits;
      const inner = height - TOP - BELOW;
      const x = (t) => this.x(t).toFixed(1);
      const y = (value) => {
        const part = Math.min(Math.max((value - low) / (high - low), -0.02), 1.02);
        return (TOP + (1 - part) * inner).toFixed(1);
      };
      const axes = make("g"), curves = make("g", { class: "curves" });
      const rows = chart.ticks || ticks(low, high, 4).map((v) => [v, String(v)]);
      for (const [value, text] of rows) {
        axes.append(make("line", { class: "grid", x1: LEFT, x2: this.width - RIGHT,
          y1: y(value), y2: y(value) }));
        axes.append(make("text", { x: LEFT - 4, y: Number(y(value)) + 4,
          "text-anchor": "end" }, text.replace("-", "−")));
      }
      for (const value of ticks(0, facts.end_s || 1, this.width / 90))
        axes.append(make("text", { x: x(value), y: height - 5,
          "text-anchor": value === 0 ? "start"
            : value > 0.97 * facts.end_s ? "end" : "middle" }, `${value} s`));
      for (const [from, to] of chart.bursts)
        curves.append(make("path", { fill: "#F0E442", "fill-opacity": 0.35,
          d: `M${x(from)} ${TOP}H${x(to)}v${inner}H${x(from)}z` }),
        make("path", { fill: "#8A7A00",
          d: `M${x(from)} ${TOP + inner}H${x(to)}v-3H${x(from)}z` }));
      for (const series of chart.series) {
        const dots = series.style === "dots";
        curves.append(make("path", { d: curve(series, x, y), stroke: series.color,
          "stroke-width": dots ? 3.5 : 1.6, "stroke-linecap": dots ? "round" : "butt",
          "stroke-dasharray": series.style === "dashes" ? "5 3" : "none" }));
      }
      this.line = make("line", { class: "cursor", y1: TOP, y2: TOP + inner });
      this.svg.replaceChildren(axes, curves, this.line);
      this.readings.replaceChildren(...chart.series.filter((s) => s.label).map((s) => {
        const swatch = make("span", { class: "swatch" });
        swatch.append(make("i", { style: `background:${s.color}` }));
        const value = make("span");
        const item = make("span", {}, swatch, `${s.label} `, value);
        item.update = () => { value.textContent = reading(s, chart.ticks); };
        return item;
      }));
      this.cursor();
    }
    cursor() {
      if (!this.line) return;
      this.line.setAttribute("x1", this.x(time));
      this.line.setAttribute("x2", this.x(time));
      for (const item of this.readings.children) item.update();
    }
  }
  document.querySelectorAll(".chart").forEach((box, k) =>
    charts.push(new Chart(box, k)));

  // Start ------------------------------------------------------------------
  new ResizeObserver(() => {
    viewer.set_3d_pane_size();
    if (ready && (view === "all" || view === "above")) setView(view);
    placeNames();
  }).observe(pane);
  viewer.controls.addEventListener("change", placeNames);
  function begin() {
    if (messagesLeft > 0 || !viewer.animator.duration) {
      setTimeout(begin, 30);
      return;
    }
    viewer.animator.play();
    viewer.animator.pause();
    ready = true;
    // With Meshcat's tone mapping, the white floor would be gray, and colors would have
    // less contrast.
    viewer.renderer.toneMapping = THREE.NoToneMapping;
    // With Meshcat's field of view of 75 degrees, objects near the edge look distorted.
    viewer.camera.fov = 45;
    viewer.set_3d_pane_size();
    document.querySelectorAll("aside input").forEach((box) => box.apply());
    setView("all");
    const asked = /[#&]t=([\d.]+)/.exec(location.hash);
    seek(asked ? asked[1] : 0);
    const still = matchMedia("(prefers-reduced-motion: reduce)").matches;
    setPlaying(!asked && !still);
    document.body.dataset.ready = "yes";
  }
  window.replay = { seek, setPlaying, setView, get time() { return time; },
    get playing() { return playing; }, shown: (path) => node(path).object };
  begin();
  requestAnimationFrame(tick);
})();

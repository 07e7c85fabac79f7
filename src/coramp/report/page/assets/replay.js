// The replay: the road from above, to scale, at any time of the records.
coramp.Road = class {
  static VIEWS = { merge: 'around the merge', whole: 'whole road' };
  static CAR_M = 1.8;

  constructor(run, canvas) {
    this.run = run;
    this.canvas = canvas;
    this.view = 'merge';
    this.centre = null;
    this.zoom = 1;
  }

  // Where the front bumper of a vehicle is: x along the mainline, y across (up), both in m.
  place(station, onMainline) {
    const road = this.run.road;
    if (onMainline) return [station, 0, 0];
    if (station >= -road.beside_m) return [station, -road.lane_width_m, 0];
    const away = -road.beside_m - station;
    const angle = (road.merge_angle_deg * Math.PI) / 180;
    return [-road.beside_m - away * Math.cos(angle),
      -road.lane_width_m - away * Math.sin(angle), angle];
  }

  range() {
    const { start_m: start, end_m: end, lane_m: lane } = this.run.road;
    const [from, to] = this.view === 'whole' ? [start, end]
      : [Math.max(start, -0.6 * lane - 40), Math.min(end, lane + 60)];
    const half = (0.5 * (to - from)) / this.zoom;
    const middle = this.centre ?? 0.5 * (from + to);
    return [middle - half, middle + half];
  }

  resize() {
    const width = this.canvas.clientWidth;
    const [from, to] = this.range();
    const scale = width / (to - from);
    const [, lowest] = this.place(Math.max(this.run.road.ramp_start_m, 1.2 * from), false);
    const high = Math.max(110, Math.min(0.75 * width, scale * (6 - lowest) + 12));
    const ratio = window.devicePixelRatio || 1;
    if (this.canvas.style.height !== `${high}px`) this.canvas.style.height = `${high}px`;
    const [w, h] = [Math.round(width * ratio), Math.round(high * ratio)];
    if (this.canvas.width !== w || this.canvas.height !== h) Object.assign(this.canvas, { width: w, height: h });
    this.scale = scale * ratio;
    this.ratio = ratio;
    this.left = from;
    this.top = Math.min(14, (0.5 * high) / scale);
  }

  // Pixels of the canvas for metres of the road.
  pixel([x, y]) {
    return [(x - this.left) * this.scale, (this.top - y) * this.scale];
  }

  draw(time, { distances, selected }) {
    this.resize();
    const ctx = this.canvas.getContext('2d');
    ctx.setTransform(1, 0, 0, 1, 0, 0);
    ctx.clearRect(0, 0, this.canvas.width, this.canvas.height);
    this.drawRoad(ctx);
    const lanes = coramp.situation(this.run, time);
    this.seen = [];
    this.pending(time).forEach((decision) => this.drawSlot(ctx, decision, time));
    for (const [lane, vehicles] of Object.entries(lanes)) {
      for (const vehicle of vehicles) this.drawVehicle(ctx, vehicle, lane === 'mainline', distances, selected);
    }
    this.drawScale(ctx);
    return lanes;
  }

  drawRoad(ctx) {
    const road = this.run.road;
    const strip = (points, width, colour) => {
      ctx.strokeStyle = coramp.colour(colour);
      ctx.lineWidth = width * this.scale;
      ctx.beginPath();
      points.forEach((point, k) => {
        const [x, y] = this.pixel(point);
        if (k === 0) ctx.moveTo(x, y); else ctx.lineTo(x, y);
      });
      ctx.stroke();
    };
    const width = road.lane_width_m;
    const ramp = [road.ramp_start_m, -road.beside_m, 0].map((s) => this.place(s, false));
    ctx.lineJoin = 'round';
    strip(ramp, width, 'asphalt');
    strip([[0, -width], [road.lane_m, -width]], width, 'asphalt-lane');
    strip([[road.start_m, 0], [road.end_m, 0]], width, 'asphalt');
    ctx.setLineDash([3 * this.scale, 3 * this.scale]);
    strip([[0, -0.5 * width], [road.lane_m, -0.5 * width]], 0.2, 'mark');
    ctx.setLineDash([]);
    const [x, y, angle] = this.place(road.decision_m, false);
    const across = 0.5 * width;
    strip([[x - across * Math.sin(angle), y + across * Math.cos(angle)],
      [x + across * Math.sin(angle), y - across * Math.cos(angle)]], 0.5, 'mark');
  }

  // Decisions that are made but whose merge is still to come.
  pending(time) {
    return this.run.decisions.filter(
      (d) => d.merge_time !== null && d.time <= time && time < d.merge_time);
  }

  // The place that a ramp vehicle will take, as it comes along the mainline.
  drawSlot(ctx, decision, time) {
    const front = decision.merge_station - this.run.road.v0_mps * (decision.merge_time - time);
    const length = this.run.length[decision.vehicle];
    const clear = 0.5 * (decision.required_gap - length);
    const [x0, y0] = this.pixel([front - length - clear, 1.5]);
    const [x1, y1] = this.pixel([front + clear, -1.5]);
    ctx.strokeStyle = coramp.colour('ramp');
    ctx.lineWidth = 1.5 * this.ratio;
    ctx.setLineDash([4 * this.ratio, 3 * this.ratio]);
    ctx.strokeRect(x0, y0, x1 - x0, y1 - y0);
    ctx.setLineDash([]);
  }

  drawVehicle(ctx, vehicle, onMainline, distances, selected) {
    const { i, station, gap, needed } = vehicle;
    const [x, y, angle] = this.place(station, onMainline);
    const [px, py] = this.pixel([x, y]);
    const length = this.run.length[i];
    this.seen.push({ i, id: this.run.ids[i], station, x, y, px: px / this.ratio, py: py / this.ratio });
    ctx.save();
    ctx.translate(px, py);
    ctx.rotate(-angle);
    if (distances && needed !== null) {
      const short = gap < needed;
      ctx.fillStyle = coramp.colour(short ? 'bad' : 'safe');
      ctx.fillRect(0, -0.8 * this.scale, Math.max(needed * this.scale, 1.5 * this.ratio), 1.6 * this.scale);
    }
    const high = coramp.Road.CAR_M * this.scale;
    ctx.fillStyle = coramp.colour(coramp.role(this.run, i));
    ctx.beginPath();
    ctx.roundRect(-length * this.scale, -0.5 * high, length * this.scale, high, 0.4 * this.scale);
    ctx.fill();
    if (i === selected) {
      ctx.strokeStyle = coramp.colour('text');
      ctx.lineWidth = 2 * this.ratio;
      ctx.stroke();
    }
    ctx.restore();
    if (this.scale / this.ratio > 6 || i === selected) this.name(ctx, this.run.ids[i], px, py - high);
  }

  name(ctx, text, x, y) {
    ctx.fillStyle = coramp.colour('text');
    ctx.font = `${10 * this.ratio}px system-ui, sans-serif`;
    ctx.fillText(text, x - 30 * this.ratio, y);
  }

  drawScale(ctx) {
    const metres = this.scale / this.ratio > 1.6 ? 20 : 100;
    const [x, y] = [10 * this.ratio, this.canvas.height - 10 * this.ratio];
    ctx.fillStyle = coramp.colour('text');
    ctx.fillRect(x, y, metres * this.scale, 2 * this.ratio);
    ctx.font = `${11 * this.ratio}px system-ui, sans-serif`;
    ctx.fillText(`${metres} m`, x, y - 5 * this.ratio);
  }

  at(px, py) {
    const inside = ({ px: x, py: y }) => px <= x + 4 && px >= x - 5 * (this.scale / this.ratio) - 4 && Math.abs(py - y) < 9;
    return this.seen.find(inside)?.i ?? null;
  }
};

coramp.Replay = class {
  static SPEEDS = [0.25, 0.5, 1, 2, 4, 8];

  constructor(runs, box, { ontime = () => {}, onselect = () => {} } = {}, before = null) {
    this.box = box;
    this.ontime = ontime;
    this.onselect = onselect;
    this.runs = runs;
    this.end = Math.max(...runs.map((run) => run.end_s));
    this.time = 0;
    this.speed = 1;
    this.playing = false;
    this.frames = 0;
    this.build();
    if (before) this.restore(before); else this.seek(this.firstTime());
  }

  state() {
    return { time: this.time, playing: this.playing, selected: this.selected, speed: this.speeds.value,
      view: this.views.value, zoom: this.zooms.value, distances: this.distances.checked };
  }

  restore(before) {
    this.selected = before.selected;
    this.speeds.value = before.speed;
    this.speed = Number(before.speed);
    this.views.value = before.view;
    this.zooms.value = before.zoom;
    this.distances.checked = before.distances;
    this.look();
    this.seek(before.time);
    if (before.playing) this.play();
  }

  firstTime() {
    const merges = this.runs.flatMap((run) => run.merge.filter((time, i) => run.on_ramp[i] && time !== null));
    return merges.length ? Math.max(0, Math.min(...merges) - 4) : Math.min(30, this.end);
  }

  build() {
    const { element } = coramp;
    this.playButton = element('button', { type: 'button', class: 'play', onclick: () => this.toggle() }, 'play');
    this.slider = element('input', {
      type: 'range', min: 0, max: this.end, step: 0.1, 'aria-label': 'time in s',
      oninput: () => this.seek(Number(this.slider.value)),
    });
    this.clock = element('output', { class: 'clock' });
    this.speeds = element('select', { onchange: () => { this.speed = Number(this.speeds.value); } },
      ...coramp.Replay.SPEEDS.map((s) => element('option', { value: s, selected: s === 1 }, `${s} ×`)));
    this.views = element('select', { onchange: () => this.look() },
      ...Object.entries(coramp.Road.VIEWS).map(([key, text]) => element('option', { value: key }, text)));
    this.zooms = element('select', { onchange: () => this.look() },
      ...[1, 2, 4].map((z) => element('option', { value: z }, `${z} ×`)));
    this.distances = element('input', { type: 'checkbox', checked: true, onchange: () => this.draw() });
    this.distances.checked = true;
    const jump = (by, text) =>
      element('button', { type: 'button', 'aria-label': text, title: text, onclick: () => this.seek(this.time + by) },
        by < 0 ? '−1 s' : '+1 s');
    this.place = element('div', { class: 'replay', role: 'group', tabindex: 0,
      'aria-label': 'Replay. Space plays and pauses, arrow keys step by a second.',
      onkeydown: (event) => this.key(event) });
    this.panels = this.runs.map((run) => this.panel(run));
    this.box.append(this.place, element('div', { class: 'tools' }, this.playButton,
      jump(-1, 'one second back'), this.slider, jump(1, 'one second on'), this.clock,
      element('label', {}, 'speed ', this.speeds), element('label', {}, 'view ', this.views),
      element('label', {}, 'enlarged ', this.zooms),
      element('label', {}, this.distances, ' safe distances')));
    new ResizeObserver(() => this.draw()).observe(this.place);
    matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => this.draw());
  }

  panel(run) {
    const { element } = coramp;
    const canvas = element('canvas', { role: 'img',
      'aria-label': `The merge seen from above, ${run.title}; the text below tells who is where` });
    canvas.addEventListener('click', (event) => this.pick(panel, event));
    const state = element('p', { class: 'state' });
    const log = element('ol', { class: 'log' });
    const panel = { run, road: new coramp.Road(run, canvas), canvas, state, log, told: null };
    this.place.append(element('figure', {}, element('figcaption', {}, run.title), canvas, state, log));
    return panel;
  }

  pick(panel, event) {
    const found = panel.road.at(event.offsetX, event.offsetY);
    if (found === null) return;
    this.selected = panel.run.ids[found];
    this.draw();
    this.onselect(panel.run, found);
  }

  key(event) {
    const acts = { ' ': () => this.toggle(), ArrowLeft: () => this.seek(this.time - 1), ArrowRight: () => this.seek(this.time + 1) };
    if (event.target !== this.place || acts[event.key] === undefined) return;
    event.preventDefault();
    acts[event.key]();
  }

  look() {
    this.panels.forEach(({ road }) => Object.assign(road, { view: this.views.value, zoom: Number(this.zooms.value) }));
    this.panels.forEach(({ road, run }) => { road.centre = road.zoom > 1 ? 0.3 * run.road.lane_m : null; });
    this.draw();
  }

  toggle() { if (this.playing) this.pause(); else this.play(); }

  play() {
    if (this.playing) return;
    if (this.time >= this.end) this.seek(0);
    this.playing = true;
    this.playButton.textContent = 'pause';
    let last = performance.now();
    const frame = (now) => {
      if (!this.playing || !this.place.isConnected) return;
      this.frames += 1;
      this.seek(this.time + ((now - last) / 1000) * this.speed);
      last = now;
      if (this.time >= this.end) this.pause(); else requestAnimationFrame(frame);
    };
    requestAnimationFrame(frame);
  }

  pause() {
    this.playing = false;
    this.playButton.textContent = 'play';
  }

  seek(time) {
    this.time = Math.min(Math.max(0, time), this.end);
    this.draw();
    this.ontime(this.time);
  }

  draw() {
    const selected = (run) => run.indexOf.get(this.selected) ?? null;
    this.slider.value = this.time;
    this.clock.textContent = `${this.time.toFixed(1)} s of ${this.end.toFixed(0)} s`;
    this.slider.setAttribute('aria-valuetext', `${this.time.toFixed(1)} s`);
    for (const panel of this.panels) {
      const options = { distances: this.distances.checked, selected: selected(panel.run) };
      const lanes = panel.road.draw(this.time, options);
      this.tell(panel, lanes);
    }
  }

  tell({ run, state, log, ...panel }, lanes) {
    const everyone = [...lanes.mainline, ...lanes.ramp];
    const spare = everyone.filter((v) => v.gap !== null).map((v) => v.gap - v.needed);
    const waiting = coramp.waiting(run, this.time);
    state.textContent = `${lanes.mainline.length} on the mainline, ${lanes.ramp.length} on ramp and `
      + `acceleration lane${waiting ? `, ${waiting} waiting outside` : ''}`
      + (spare.length ? `; least distance beyond Eq. 1: ${Math.min(...spare).toFixed(2)} m` : '');
    const made = run.decisions.filter((d) => d.time <= this.time).slice(-3).reverse();
    const key = made.map((d) => `${d.vehicle}@${d.time}`).join();
    if (log.dataset.key === key) return;
    log.dataset.key = key;
    log.replaceChildren(...made.map((d) => coramp.element('li', {},
      coramp.element('strong', {}, `${d.time.toFixed(1)} s, ${run.ids[d.vehicle]}: `), d.told)));
  }

  // What is drawn where, for tests and for those who build on it; pixels of the page's canvas.
  positions(panel = 0) {
    return this.panels[panel].road.seen;
  }
};

// The replay of a corridor: the road as it lies, all of its sites, and the vehicles on it.

// A run as the replay uses it: whole numbers of the page, added up, in m, rad and m/s.
coramp.corridorOf = (data) => {
  const summed = (values, unit) => {
    let sum = 0;
    return Float32Array.from(values, (value) => (sum += value) * unit);
  };
  data.vehicles.forEach((vehicle) => {
    vehicle.x = summed(vehicle.x, 0.1);
    vehicle.y = summed(vehicle.y, 0.1);
    vehicle.angle = summed(vehicle.angle, Math.PI / 180);
    vehicle.speed = summed(vehicle.speed, 0.1);
  });
  return data;
};

// Where a vehicle is at a time: its front, its direction and its speed; null where it is not there.
coramp.placeAt = (run, vehicle, time) => {
  const at = time / run.period_s - vehicle.from;
  const last = vehicle.x.length - 1;
  if (at < 0 || at > last) return null;
  const k = Math.min(Math.floor(at), Math.max(0, last - 1));
  const share = last === 0 ? 0 : at - k;
  const mixed = (values) => (last === 0 ? values[0] : values[k] + share * (values[k + 1] - values[k]));
  return { x: mixed(vehicle.x), y: mixed(vehicle.y), angle: mixed(vehicle.angle), speed: mixed(vehicle.speed) };
};

// Whether a coordinator has a vehicle: driver, coordinated, or automated and left to SUMO.
coramp.kindAt = (vehicle, time) => {
  if (!vehicle.automated) return 'driver';
  return vehicle.zones.some(([from, to]) => from <= time && time < to) ? 'automated' : 'moved';
};

// One picture of the road, which can be moved and enlarged.
coramp.CorridorMap = class {
  static SITE_M = 450;
  static TALL = 0.22;
  static MOST_TALL = 0.55;
  static LEAST_TALL_PX = 170;
  static LANES_M = 16;
  static LEAST = { lane: 1.2, long: 5, wide: 2.6 };

  constructor(run, canvas, onchange) {
    Object.assign(this, { run, canvas, onchange });
    this.seen = [];
    canvas.addEventListener('wheel', (event) => {
      if (!event.ctrlKey && document.activeElement !== canvas) return;
      event.preventDefault();
      this.enlarge(event.deltaY < 0 ? 1.25 : 0.8, event.offsetX, event.offsetY);
    }, { passive: false });
    canvas.addEventListener('pointerdown', (event) => { this.drags = [event.offsetX, event.offsetY]; });
    canvas.addEventListener('pointerup', () => { this.drags = null; });
    canvas.addEventListener('pointerleave', () => { this.drags = null; });
    canvas.addEventListener('pointermove', (event) => this.drag(event));
    this.showAll();
  }

  get size() { return [this.canvas.clientWidth || 1, this.canvas.clientHeight || 1]; }

  // The whole corridor, or what lies around a site.
  showAll() {
    const points = this.run.shapes.flatMap(({ xy }) => Array.from({ length: xy.length / 2 }, (_, k) => [xy[2 * k], xy[2 * k + 1]]));
    const [xs, ys] = [points.map(([x]) => x), points.map(([, y]) => y)];
    const range = (values) => [values.reduce((a, b) => Math.min(a, b)), values.reduce((a, b) => Math.max(a, b))];
    const [[x0, x1], [y0, y1]] = [range(xs), range(ys)];
    this.window = { x: 0.5 * (x0 + x1), y: 0.5 * (y0 + y1), wide: 1.06 * (x1 - x0) + 20, tall: 1.06 * (y1 - y0) + 20 };
    this.tall = Math.min(this.window.tall / this.window.wide, coramp.CorridorMap.MOST_TALL);
  }

  showSite({ x, y }) {
    const { SITE_M, TALL } = coramp.CorridorMap;
    this.window = { x, y, wide: SITE_M, tall: TALL * SITE_M };
    this.tall = TALL;
  }

  // Around a place of the picture, or its middle.
  enlarge(by, px = this.size[0] / 2, py = this.size[1] / 2) {
    const before = this.fromPx(px, py);
    this.window.wide /= by;
    this.window.tall /= by;
    this.layOut();
    const after = this.fromPx(px, py);
    this.window.x += before.x - after.x;
    this.window.y += before.y - after.y;
    this.onchange();
  }

  drag(event) {
    if (!this.drags || !event.buttons) return;
    const [x, y] = this.drags;
    this.drags = [event.offsetX, event.offsetY];
    this.window.x -= (event.offsetX - x) / this.scale;
    this.window.y += (event.offsetY - y) / this.scale;
    this.onchange();
  }

  layOut() {
    const [width, height] = this.size;
    this.scale = Math.min(width / this.window.wide, height / this.window.tall);
    this.toPx = ({ x, y }) => [(x - this.window.x) * this.scale + width / 2, (this.window.y - y) * this.scale + height / 2];
    this.fromPx = (px, py) => ({ x: (px - width / 2) / this.scale + this.window.x, y: this.window.y - (py - height / 2) / this.scale });
  }

  draw(time, colouring, chosen) {
    this.canvas.style.height = `${Math.max(coramp.CorridorMap.LEAST_TALL_PX, this.tall * this.size[0])}px`;
    const [width, height] = this.size;
    const ratio = window.devicePixelRatio || 1;
    const [w, h] = [Math.round(width * ratio), Math.round(height * ratio)];
    if (this.canvas.width !== w || this.canvas.height !== h) Object.assign(this.canvas, { width: w, height: h });
    this.layOut();
    const ctx = this.canvas.getContext('2d');
    ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
    ctx.clearRect(0, 0, width, height);
    coramp.drawLanes(ctx, this.run.shapes, this.toPx, this.scale, () => 'asphalt', coramp.CorridorMap.LEAST.lane);
    this.seen = [];
    this.there = 0;
    this.speeds = 0;
    this.run.vehicles.forEach((vehicle) => {
      const place = coramp.placeAt(this.run, vehicle, time);
      if (place === null) return;
      this.there += 1;
      this.speeds += place.speed;
      const [px, py] = this.toPx(place);
      if (px < -40 || py < -40 || px > width + 40 || py > height + 40) return;
      this.seen.push({ vehicle, px, py, speed: place.speed });
      this.drawVehicle(ctx, vehicle, place, px, py, colouring(vehicle, place, time), vehicle.id === chosen);
    });
    this.nameSites(ctx);
  }

  drawVehicle(ctx, vehicle, place, px, py, colour, chosen) {
    const { long, wide } = coramp.CorridorMap.LEAST;
    const [length, high] = [Math.max(vehicle.length * this.scale, long), Math.max(2 * this.scale, wide)];
    ctx.save();
    ctx.translate(px, py);
    ctx.rotate(-place.angle);
    ctx.beginPath();
    ctx.roundRect(-length, -0.5 * high, length, high, 0.3 * high);
    ctx.fillStyle = colour;
    ctx.fill();
    if (high > 5 || chosen) {
      ctx.lineWidth = chosen ? 3 : 0.8;
      ctx.strokeStyle = coramp.colour(chosen ? 'text' : 'outline');
      ctx.stroke();
    }
    ctx.restore();
  }

  nameSites(ctx) {
    ctx.font = '12px system-ui, sans-serif';
    ctx.textBaseline = 'bottom';
    const [width, height] = this.size;
    const up = 14 + coramp.CorridorMap.LANES_M * this.scale;
    ctx.fillStyle = coramp.colour('text');
    this.run.sites.forEach((site) => {
      const [px, py] = this.toPx(site);
      if (px < 0 || px > width || py < 0 || py > height) return;
      const text = site.name.split(':')[0];
      const wide = ctx.measureText(text).width;
      ctx.fillText(text, Math.min(Math.max(px - wide / 2, 2), width - wide - 2), Math.max(py - up, 14));
      ctx.fillRect(px - 0.75, py - up + 1, 1.5, 9);
    });
  }

  // The vehicle nearest to a place of the picture, null where there is none near.
  at(x, y) {
    const near = this.seen.map((own) => ({ ...own, away: Math.hypot(own.px - x, own.py - y) }))
      .filter(({ away }) => away < 14).sort((a, b) => a.away - b.away);
    return near[0]?.vehicle.id ?? null;
  }
};

coramp.CorridorReplay = class {
  static SPEEDS = [0.5, 1, 2, 5, 10, 30];
  static KEYS = 'Keys: space plays and pauses, ← → step by 1 s, Home and End go to both ends, + and − enlarge.';

  constructor(runs, box) {
    this.runs = runs;
    this.end = Math.max(...runs.map((run) => run.end_s));
    this.time = Math.min(0.5 * this.end, 60);
    this.speed = 1;
    this.playing = false;
    this.chosen = null;
    this.build(box);
    this.draw();
  }

  build(box) {
    const { element } = coramp;
    this.controls();
    this.place = element('div', { class: 'replay', role: 'group', tabindex: 0, 'aria-label': `Replay. ${coramp.CorridorReplay.KEYS}` });
    this.panels = this.runs.map((run) => this.panel(run));
    this.legend = element('ul', { class: 'legend' });
    const cut = this.runs.some((run) => run.cut);
    box.append(element('div', { class: 'tools' }, element('label', {}, 'show ', this.views), this.closer, this.further,
      element('label', {}, 'colours ', this.colours)), this.place, this.legend,
    element('p', { class: 'hint' }, 'Drag the picture to move it; click it, then turn the wheel, to enlarge it. From afar vehicles are '
      + `drawn larger than they are. ${coramp.CorridorReplay.KEYS}`),
    cut ? element('p', { class: 'note' }, `Only the first ${this.end.toFixed(0)} s are shown: the rest would make this page too large.`) : '',
    this.bar);
    new ResizeObserver(() => this.draw()).observe(this.place);
    matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => this.draw());
    document.addEventListener('keydown', (event) => this.key(event));
  }

  controls() {
    const { element } = coramp;
    const option = (value, text) => element('option', { value }, text);
    this.views = element('select', { onchange: () => this.look() }, option('', 'the whole corridor'),
      ...this.runs[0].sites.map((site, k) => option(k, site.name)));
    this.colours = element('select', { onchange: () => this.draw() }, option('speed', 'by speed'), option('kind', 'by who drives'));
    const button = (text, label, onclick) => element('button', { type: 'button', 'aria-label': label, title: label, onclick }, text);
    this.closer = button('+', 'enlarge', () => this.enlarge(1.5));
    this.further = button('−', 'make smaller', () => this.enlarge(1 / 1.5));
    this.playButton = element('button', { type: 'button', class: 'play', onclick: () => this.toggle() }, 'play');
    this.slider = element('input', { type: 'range', min: 0, max: this.end, step: 0.1, 'aria-label': 'time in s',
      oninput: () => { this.pause(); this.seek(Number(this.slider.value)); } });
    this.clock = element('output', { class: 'clock' });
    this.pace = element('select', { 'aria-label': 'speed of playing', onchange: () => { this.speed = Number(this.pace.value); } },
      ...coramp.CorridorReplay.SPEEDS.map((s) => element('option', { value: s, selected: s === 1 }, `${s} ×`)));
    this.bar = element('div', { class: 'bar', role: 'group', 'aria-label': 'play' },
      element('div', { class: 'buttons' }, this.playButton, button('−1 s', 'one second back', () => this.seek(this.time - 1)),
        button('+1 s', 'one second on', () => this.seek(this.time + 1)), this.pace, this.clock), this.slider);
  }

  panel(run) {
    const { element } = coramp;
    const canvas = element('canvas', { class: 'corridor', role: 'img', tabindex: -1,
      'aria-label': `The corridor seen from above, ${run.title}; the text below tells how many drive` });
    const state = element('p', { class: 'state' });
    this.place.append(element('figure', {}, element('figcaption', {}, run.title), canvas, state));
    const panel = { run, canvas, state, map: new coramp.CorridorMap(run, canvas, () => this.draw()) };
    canvas.addEventListener('click', (event) => {
      canvas.focus({ preventScroll: true });
      this.chosen = panel.map.at(event.offsetX, event.offsetY);
      this.draw();
    });
    return panel;
  }

  look() {
    this.panels.forEach(({ run, map }) => (this.views.value === '' ? map.showAll() : map.showSite(run.sites[this.views.value])));
    this.draw();
  }

  enlarge(by) { this.panels.forEach(({ map }) => map.enlarge(by)); }

  key(event) {
    const acts = { ' ': () => this.toggle(), ArrowLeft: () => this.seek(this.time - 1), ArrowRight: () => this.seek(this.time + 1),
      Home: () => this.seek(0), End: () => this.seek(this.end), '+': () => this.enlarge(1.5), '-': () => this.enlarge(1 / 1.5) };
    const free = [document.body, this.place, ...this.panels.map(({ canvas }) => canvas)].includes(event.target);
    if (!free || acts[event.key] === undefined || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    acts[event.key]();
  }

  toggle() { if (this.playing) this.pause(); else this.play(); }

  play() {
    if (this.time >= this.end) this.seek(0);
    this.playing = true;
    this.playButton.textContent = 'pause';
    let last = performance.now();
    const frame = (now) => {
      if (!this.playing) return;
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
  }

  draw() {
    const colouring = this.colours.value === 'speed'
      ? (vehicle, place) => coramp.speedColour(place.speed / this.runs[0].v0_mps)
      : (vehicle, place, time) => coramp.colour(coramp.kindAt(vehicle, time));
    this.slider.value = this.time;
    this.clock.textContent = `${this.time.toFixed(1)} of ${this.end.toFixed(0)} s`;
    this.slider.setAttribute('aria-valuetext', `${this.time.toFixed(1)} s`);
    this.panels.forEach((panel) => {
      panel.map.draw(this.time, colouring, this.chosen);
      panel.state.textContent = this.told(panel).join(' · ');
    });
    this.tellColours();
  }

  told({ run, map }) {
    const waiting = run.waits.filter(([due, entered]) => due <= this.time && (entered === null || this.time < entered)).length;
    const chosen = run.vehicles.find(({ id }) => id === this.chosen);
    const place = chosen ? coramp.placeAt(run, chosen, this.time) : null;
    return [`${map.there} vehicles on the road`, ...(map.there ? [`mean speed ${coramp.kmh(map.speeds / map.there)}`] : []),
      ...(waiting ? [`${waiting} waiting to enter`] : []), ...(place ? [`${chosen.id}: ${coramp.kmh(place.speed)}`] : [])];
  }

  tellColours() {
    const { element } = coramp;
    const key = `${this.colours.value} ${matchMedia('(prefers-color-scheme: dark)').matches}`;
    if (this.legend.dataset.key === key) return;
    this.legend.dataset.key = key;
    const item = (colour, text) => element('li', {},
      element('span', { class: 'mark', style: `background: ${colour}`, 'aria-hidden': 'true' }), text);
    const v0 = this.runs[0].v0_mps;
    this.legend.replaceChildren(...(this.colours.value === 'speed'
      ? [0, 0.3, 0.55, 0.78, 1].map((share) => item(coramp.speedColour(share), coramp.kmh(share * v0)))
      : [item(coramp.colour('driver'), 'driver'), item(coramp.colour('automated'), 'automated, in a coordinator’s zone'),
        item(coramp.colour('moved'), 'automated, outside zones')]));
  }
};

coramp.showCorridor = async () => {
  const box = document.getElementById('show');
  try {
    const runs = await Promise.all([...document.querySelectorAll('script[type="application/gzip"]')].map(coramp.data));
    coramp.shown = new coramp.CorridorReplay(runs.map(coramp.corridorOf), box);
  } catch (error) {
    box.replaceChildren(coramp.element('p', { role: 'alert', class: 'problem' }, `This cannot be shown: ${error.message}`));
  }
};
coramp.ready = coramp.showCorridor();
window.coramp = coramp;

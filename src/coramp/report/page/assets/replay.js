// The replay: runs from above, one below the other, at the same time; and what plays them.
coramp.Replay = class {
  static SPEEDS = [0.25, 0.5, 1, 2, 4, 8];
  static KEYS = 'Keys: space plays and pauses, ← → step by 1 s, comma and full stop by 0.1 s, Home and End go '
    + 'to both ends, n and p choose the next and previous ramp vehicle.';

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
    this.selected = null;
    this.hovered = null;
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

  // Half-way through the arrivals, a few seconds before a merge, so that there is something to see.
  firstTime() {
    const half = 0.5 * Math.max(0, ...this.runs[0].scheduled);
    const merges = this.runs[0].merge.filter((time, i) => this.runs[0].on_ramp[i] && time !== null);
    const next = merges.filter((time) => time >= half);
    return Math.max(0, (next.length ? Math.min(...next) : Math.max(half, ...merges)) - 4);
  }

  build() {
    const { element } = coramp;
    this.buildControls();
    this.place = element('div', { class: 'replay', role: 'group', tabindex: 0, 'aria-label': `Replay. ${coramp.Replay.KEYS}` });
    this.panels = this.runs.map((run) => this.panel(run));
    const deciding = this.panels.filter(({ run }) => run.decisions.length > 0);
    this.place.append(...deciding.map(({ run, log }) => element('div', { class: 'latest' },
      element('p', {}, `Latest decisions, ${run.title}`), log)));
    const cooperative = deciding.length > 0;
    this.legend = coramp.replayLegend(this.runs[0], cooperative,
      this.runs.some((run) => run.automated), this.runs);
    this.box.append(this.place, this.legend,
      element('p', { class: 'hint' }, 'Lengths are to scale. Everyone drives to the right; the road goes on in the '
        + `row below. ${coramp.Replay.KEYS}`),
      element('div', { class: 'tools' },
        element('label', {}, 'view ', this.views), element('label', {}, 'enlarged ', this.zooms),
        element('label', {}, this.distances, ' safe distances'),
        this.runs.some((run) => coramp.lapses(run).length) ? element('button', { type: 'button',
          onclick: () => this.nextLapse() }, 'next fallback or lost sight') : null));
    new ResizeObserver(() => this.draw()).observe(this.place);
    matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => this.draw());
    const listener = (event) => {
      if (this.place.isConnected) this.key(event); else document.removeEventListener('keydown', listener);
    };
    document.addEventListener('keydown', listener);
  }

  buildControls() {
    const { element } = coramp;
    this.playButton = element('button', { type: 'button', class: 'play', onclick: () => this.toggle() }, 'play');
    this.slider = element('input', {
      type: 'range', min: 0, max: this.end, step: 0.1, 'aria-label': 'time in s', list: 'world-events',
      oninput: () => this.seek(Number(this.slider.value)),
    });
    this.clock = element('output', { class: 'clock' });
    this.speeds = element('select', { 'aria-label': 'speed of playing', onchange: () => { this.speed = Number(this.speeds.value); } },
      ...coramp.Replay.SPEEDS.map((s) => element('option', { value: s, selected: s === 1 }, `${s} ×`)));
    this.views = element('select', { onchange: () => this.look() },
      ...Object.entries(coramp.Road.VIEWS).map(([key, text]) => element('option', { value: key }, text)));
    this.zooms = element('select', { onchange: () => this.look() },
      ...[1, 2, 4].map((z) => element('option', { value: z }, `${z} ×`)));
    this.distances = element('input', { type: 'checkbox', onchange: () => this.draw() });
    const step = (by, label, text) => element('button', { type: 'button', 'aria-label': label, title: label,
      onclick: () => this.seek(this.time + by) }, text);
    this.bar = element('div', { class: 'bar', role: 'group', 'aria-label': 'play' },
      element('div', { class: 'buttons' }, this.playButton, step(-1, 'one second back', '−1 s'),
        step(1, 'one second on', '+1 s'), this.speeds, this.clock), this.timeAxis(), ...this.happened());
  }

  // The slider, and below it what failed when.
  timeAxis() {
    this.strips = this.runs.map((run) => new coramp.Strip(run, this.end, (time) => { this.pause(); this.seek(time); }))
      .filter((strip) => !strip.isEmpty);
    if (!this.strips.length) return this.slider;
    return coramp.element('div', { class: 'axis' }, this.slider,
      ...this.strips.flatMap((strip) => [strip.names, strip.canvas]));
  }

  // What happened by itself: ticks on the time axis, and buttons that go there.
  happened() {
    const { element } = coramp;
    const events = this.runs.flatMap((run) => (run.events ?? []).map((event) => [run, event]));
    if (!events.length) return [];
    const seconds = (event) => `${event.time.toFixed(1)} s`;
    const text = (run, event) => `${seconds(event)}: ${event.what} (${run.ids[event.vehicle]})`;
    const button = ([run, event]) => element('button', { type: 'button',
      onclick: () => this.seek(Math.max(0, event.time - 2)) }, text(run, event));
    return [element('datalist', { id: 'world-events' },
      ...events.map(([, event]) => element('option', { value: event.time, label: event.what }))),
    element('div', { class: 'happened', role: 'group', 'aria-label': 'what happened by itself' }, ...events.map(button))];
  }

  panel(run) {
    const { element } = coramp;
    const canvas = element('canvas', { role: 'img',
      'aria-label': `The merge seen from above, ${run.title}; the text below tells who is where` });
    canvas.addEventListener('click', (event) => this.pick(panel, event));
    canvas.addEventListener('pointermove', (event) => this.hover(panel, event));
    canvas.addEventListener('pointerleave', () => this.hover(panel, null));
    const delay = element('p', { class: 'delay' });
    const state = element('p', { class: 'state' });
    const log = element('ol', { class: 'log' });
    const panel = { run, road: new coramp.Road(run, canvas), canvas, delay, state, log };
    this.place.append(element('figure', {},
      element('figcaption', {}, element('span', {}, run.title), delay), canvas, state));
    return panel;
  }

  pick(panel, event) {
    const found = panel.road.at(event.offsetX, event.offsetY);
    if (found !== null) this.choose(panel.run, found);
  }

  choose(run, i) {
    this.selected = run.ids[i];
    this.draw();
    this.onselect(run, i);
  }

  hover(panel, event) {
    const found = event === null ? null : panel.road.at(event.offsetX, event.offsetY);
    const id = found === null ? null : panel.run.ids[found];
    panel.canvas.style.cursor = id === null ? '' : 'pointer';
    if (id === this.hovered) return;
    this.hovered = id;
    this.draw();
  }

  // Keys hold where the replay has the focus, and where nothing has it and the replay is in sight.
  key(event) {
    const acts = { ' ': () => this.toggle(), ArrowLeft: () => this.seek(this.time - 1),
      ArrowRight: () => this.seek(this.time + 1), ',': () => this.seek(this.time - 0.1),
      '.': () => this.seek(this.time + 0.1), Home: () => this.seek(0), End: () => this.seek(this.end),
      n: () => this.next(1), p: () => this.next(-1) };
    const { top, bottom } = this.place.getBoundingClientRect();
    const free = event.target === document.body && top < 0.7 * innerHeight && bottom > 0;
    if ((event.target !== this.place && !free) || acts[event.key] === undefined) return;
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    acts[event.key]();
  }

  // Chooses another ramp vehicle of those in the first picture.
  next(by) {
    const { run, road } = this.panels[0];
    const seen = new Set(road.seen.map(({ i }) => i));
    const there = run.everyone.filter((i) => run.on_ramp[i] && seen.has(i));
    if (there.length === 0) return;
    const at = there.indexOf(run.indexOf.get(this.selected));
    const place = at < 0 ? (by > 0 ? 0 : there.length - 1) : (at + by + there.length) % there.length;
    this.choose(run, there[place]);
  }

  // Goes to the next time at which a vehicle near the merge fell back or was not known.
  nextLapse() {
    const [from, to] = [-200, this.runs[0].road.lane_m];
    const near = (run, { vehicle, from: time }) => {
      const { station } = coramp.state(run, vehicle, time);
      return station > from && station < to;
    };
    const found = this.runs.flatMap((run) => coramp.lapses(run).filter((lapse) => near(run, lapse))
      .map((lapse) => ({ run, ...lapse })));
    const next = found.find((lapse) => lapse.from > this.time + 0.05) ?? found[0];
    if (!next) return;
    this.pause();
    this.seek(next.from + 0.2);
    this.choose(next.run, next.vehicle);
  }

  look() {
    this.panels.forEach(({ road }) => Object.assign(road, { view: this.views.value, zoom: Number(this.zooms.value) }));
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
    const place = (run, id) => run.indexOf.get(id) ?? null;
    this.slider.value = this.time;
    this.legend.classList.toggle('with-distances', this.distances.checked);
    this.clock.textContent = `${this.time.toFixed(1)} of ${this.end.toFixed(0)} s`;
    this.slider.setAttribute('aria-valuetext', `${this.time.toFixed(1)} s`);
    for (const panel of this.panels) {
      const lanes = panel.road.draw(this.time, { distances: this.distances.checked,
        selected: place(panel.run, this.selected), hovered: place(panel.run, this.hovered) });
      this.tell(panel, lanes);
    }
  }

  tell({ run, delay, state, log }, lanes) {
    const lost = coramp.delaySoFar(run, this.time);
    delay.replaceChildren('delay so far ', coramp.element('strong', {}, lost === null ? '–' : `${lost.toFixed(1)} s`),
      coramp.element('span', { class: 'more' }, ' per vehicle'));
    state.textContent = [...this.counts(run, lanes), ...this.smallestGap(lanes), ...this.chosen(run, lanes)].join(' · ');
    const made = run.decisions.filter((d) => d.time <= this.time).slice(-2).reverse();
    const key = made.map((d) => `${d.vehicle}@${d.time}`).join();
    if (log.dataset.key === key) return;
    log.dataset.key = key;
    log.replaceChildren(...made.map((d) => coramp.element('li', {},
      coramp.element('strong', {}, `${d.time.toFixed(1)} s, ${run.ids[d.vehicle]}: `), d.told)));
  }

  counts(run, lanes) {
    const slow = (vehicles, main) => vehicles.filter((v) => coramp.isSlow(run, main, v.speed)).length;
    const few = (count, text) => (count ? [`${count} ${text}`] : []);
    const everyone = [...lanes.mainline, ...lanes.ramp];
    return [`${lanes.mainline.length} on the mainline`, `${lanes.ramp.length} on ramp and acceleration lane`,
      ...few(slow(lanes.mainline, true) + slow(lanes.ramp, false), 'slow'),
      ...few(everyone.filter((v) => v.speed < coramp.STOPPED_MPS).length, 'standing'),
      ...few(coramp.waiting(run, this.time), 'waiting to enter'), ...coramp.knownTold(run, lanes, this.time)];
  }

  smallestGap(lanes) {
    const gaps = [...lanes.mainline, ...lanes.ramp].filter((v) => v.gap !== null);
    if (gaps.length === 0) return [];
    const least = gaps.reduce((a, b) => (b.gap < a.gap ? b : a));
    const spare = Math.min(...gaps.map((v) => v.gap - v.needed));
    const text = spare < 0 ? `one pair ${(-spare).toFixed(1)} m nearer than is safe`
      : `all at least ${spare.toFixed(1)} m beyond the safe distance`;
    return [`smallest gap now ${least.gap.toFixed(1)} m`, text];
  }

  chosen(run, lanes) {
    const i = run.indexOf.get(this.selected);
    const found = [...lanes.mainline, ...lanes.ramp].find((v) => v.i === i);
    if (!found) return [];
    return [`${this.selected}: ${coramp.kmh(found.speed)}, delay so far ${coramp.delayOf(run, i, this.time).toFixed(1)} s`,
      ...coramp.knownOf(run, i, this.time)];
  }

  // What is drawn where, for tests and for those who build on it; pixels of the page's canvas.
  positions(panel = 0) {
    return this.panels[panel].road.seen;
  }
};

// The time-space diagram of a run: uPlot draws axes and zooms, the lines are drawn into it.
coramp.Diagram = class {
  static NEAR_PX = 18;

  constructor(run, box, { onselect = () => {}, ontime = () => {} } = {}) {
    this.run = run;
    this.box = box;
    this.onselect = onselect;
    this.ontime = ontime;
    this.hovered = null;
    this.selected = null;
    this.time = 0;
    this.lines = new Map();
    const { start_m: start, ramp_start_m: ramp, end_m: end } = run.road;
    this.full = { x: [0, run.end_s], y: [Math.min(start, ramp), end] };
    this.build();
  }

  build() {
    const { element } = coramp;
    this.tip = element('div', { class: 'tip', hidden: true, 'aria-hidden': 'true' });
    this.now = element('div', { class: 'now' });
    this.place = element('div', {
      class: 'plot', tabindex: 0, role: 'group',
      'aria-label': `Time-space diagram, ${this.run.title}. Arrow keys move it, plus and minus zoom, `
        + 'n and p go to the next and previous ramp vehicle, 0 shows all.',
      onkeydown: (event) => this.key(event),
    });
    this.box.append(this.tools(), this.place);
    this.plot = new uPlot(this.options(), [this.full.x, this.full.y], this.place);
    this.plot.over.append(this.tip, this.now);
    this.plot.over.addEventListener('click', () => this.clicked());
    this.plot.over.addEventListener('dblclick', () => this.show(this.full.x, this.full.y));
    new ResizeObserver(() => this.resize()).observe(this.place);
    matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => this.recolour());
    this.showAround(0);
  }

  tools() {
    const { element } = coramp;
    const button = (label, text, act) =>
      element('button', { type: 'button', 'aria-label': label, title: label, onclick: act }, text);
    this.choice = element('select', { onchange: () => this.choose(Number(this.choice.value)) },
      element('option', { value: -1 }, 'choose …'));
    this.run.everyone.forEach((i) => {
      const decision = (this.run.decisionsOf.get(i) ?? []).findLast((d) => d.rung !== 'hold');
      const note = decision ? `, ${decision.rung}` : '';
      const bad = this.run.violating.has(i) ? ', too near' : '';
      this.choice.append(element('option', { value: i }, `${this.run.ids[i]}${note}${bad}`));
    });
    return element('div', { class: 'tools' },
      button('zoom in', '+', () => this.zoom(0.5)),
      button('zoom out', '−', () => this.zoom(2)),
      button('earlier', '←', () => this.pan(-0.5)),
      button('later', '→', () => this.pan(0.5)),
      button('whole run', 'whole run', () => this.show(this.full.x, this.full.y)),
      this.run.violations.length
        ? button('next violation', 'next violation', () => this.nextViolation()) : null,
      element('label', {}, 'vehicle ', this.choice));
  }

  // A minute and a half around a time, as far as the run has so much.
  showAround(time) {
    const from = Math.max(0, Math.min(time - 30, this.run.end_s - 90));
    this.show([from, Math.min(from + 90, this.run.end_s)], this.full.y);
  }

  options() {
    const axis = () => ({
      stroke: coramp.colour('text'),
      grid: { stroke: coramp.colour('grid'), width: 1 },
      ticks: { stroke: coramp.colour('grid'), width: 1 },
      font: '12px system-ui, sans-serif',
      labelFont: '12px system-ui, sans-serif',
    });
    return {
      width: this.place.clientWidth || 800,
      height: this.height(),
      legend: { show: false },
      scales: { x: { time: false }, y: { range: (_, low, high) => [low, high] } },
      axes: [{ ...axis(), label: 'time (s)' }, { ...axis(), label: 'station (m)', size: 56 }],
      series: [{}, { show: true, stroke: 'transparent', points: { show: false } }],
      cursor: { drag: { x: true, y: true, uni: 20 }, points: { show: false } },
      hooks: {
        drawClear: [(u) => this.drawLane(u)],
        draw: [(u) => this.draw(u)],
        setCursor: [(u) => this.hover(u)],
        setScale: [() => this.placeNow()],
      },
    };
  }

  height() { return window.innerWidth < 600 ? 300 : 420; }

  resize() {
    const width = this.place.clientWidth;
    if (width > 0 && width !== this.plot.width) this.plot.setSize({ width, height: this.height() });
  }

  recolour() {
    const { min, max } = this.plot.scales.x;
    const { min: low, max: high } = this.plot.scales.y;
    this.plot.destroy();
    this.plot = new uPlot(this.options(), [this.full.x, this.full.y], this.place);
    this.plot.over.append(this.tip, this.now);
    this.plot.over.addEventListener('click', () => this.clicked());
    this.show([min, max], [low, high]);
  }

  show([from, to], [low, high]) {
    this.plot.batch(() => {
      this.plot.setScale('x', { min: from, max: to });
      this.plot.setScale('y', { min: low, max: high });
    });
  }

  zoom(factor) {
    for (const [scale, [first, last]] of Object.entries(this.full)) {
      const { min, max } = this.plot.scales[scale];
      const half = Math.min(0.5 * factor * (max - min), 0.5 * (last - first));
      const middle = Math.min(Math.max(0.5 * (min + max), first + half), last - half);
      this.plot.setScale(scale, { min: middle - half, max: middle + half });
    }
  }

  pan(share) {
    const { min, max } = this.plot.scales.x;
    const way = Math.min(Math.max(share * (max - min), this.full.x[0] - min), this.full.x[1] - max);
    this.plot.setScale('x', { min: min + way, max: max + way });
  }

  key(event) {
    const acts = {
      '+': () => this.zoom(0.5), '=': () => this.zoom(0.5), '-': () => this.zoom(2),
      ArrowLeft: () => this.pan(-0.25), ArrowRight: () => this.pan(0.25),
      0: () => this.show(this.full.x, this.full.y),
      n: () => this.step(1), p: () => this.step(-1),
    };
    if (acts[event.key] === undefined || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    acts[event.key]();
  }

  step(by) {
    const ramp = this.run.everyone.filter((i) => this.run.on_ramp[i]);
    if (ramp.length === 0) return;
    const place = ramp.indexOf(this.selected) + by;
    this.choose(ramp[(place + ramp.length) % ramp.length]);
  }

  nextViolation() {
    this.violation = ((this.violation ?? -1) + 1) % this.run.violations.length;
    const { time, rear, front } = this.run.violations[this.violation];
    const station = coramp.state(this.run, front, time).station;
    this.show([time - 5, time + 5], [station - 60, station + 40]);
    this.select(rear);
  }

  choose(i) {
    if (i < 0) return;
    const from = coramp.entry(this.run, i);
    const to = coramp.exit(this.run, i);
    this.show([Math.max(0, from - 5), Math.min(this.run.end_s, to + 5)], this.full.y);
    this.select(i);
  }

  select(i) {
    this.selected = i;
    this.choice.value = i ?? -1;
    this.plot.redraw(false);
    this.onselect(i);
  }

  clicked() {
    if (this.hovered !== null) this.select(this.hovered);
    const { left } = this.plot.cursor;
    if (left >= 0) this.ontime(this.plot.posToVal(left, 'x'));
  }

  // The vehicle whose line is nearest to a place, null if none is near; in pixels of the page.
  nearest(left, top) {
    const time = this.plot.posToVal(left, 'x');
    let found = null;
    let least = coramp.Diagram.NEAR_PX;
    for (const i of this.run.everyone) {
      if (!coramp.isThere(this.run, i, time)) continue;
      const y = this.plot.valToPos(coramp.state(this.run, i, time).station, 'y');
      if (Math.abs(y - top) < least) {
        least = Math.abs(y - top);
        found = i;
      }
    }
    return found;
  }

  hover(u) {
    const { left, top } = u.cursor;
    const found = left >= 0 ? this.nearest(left, top) : null;
    const changed = found !== this.hovered;
    this.hovered = found;
    this.tip.hidden = found === null;
    if (found !== null) this.tell(found, u.posToVal(left, 'x'), left, top);
    if (changed) u.redraw(false);
  }

  tell(i, time, left, top) {
    const { element } = coramp;
    const decision = coramp.mainDecision(this.run, i);
    this.tip.replaceChildren(
      element('strong', {}, this.run.ids[i]),
      ...coramp.story(this.run, i, time).map((line) => element('div', {}, line)),
      ...(decision === null ? [] : coramp.keyQuantities(this.run, decision))
        .map((line) => element('div', { class: 'equation' }, line)));
    const { width, height } = this.plot.over.getBoundingClientRect();
    const wide = Math.min(380, width);
    this.tip.style.width = `${wide}px`;
    this.tip.style.left = `${Math.max(0, Math.min(left + 14, width - wide))}px`;
    this.tip.style.top = top > height / 2 ? 'auto' : `${top + 16}px`;
    this.tip.style.bottom = top > height / 2 ? `${height - top + 12}px` : 'auto';
  }

  setTime(time) {
    this.time = time;
    this.placeNow();
  }

  placeNow() {
    if (!this.plot) return;
    const left = this.plot.valToPos(this.time, 'x');
    this.now.hidden = !(left >= 0 && left <= this.plot.over.clientWidth);
    this.now.style.transform = `translateX(${left}px)`;
  }

  clipped(u, draw) {
    const { ctx, bbox } = u;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    draw(ctx, bbox);
    ctx.restore();
  }

  drawLane(u) {
    this.clipped(u, (ctx, bbox) => {
      const [top, bottom] = [this.run.road.lane_m, 0].map((m) => u.valToPos(m, 'y', true));
      ctx.fillStyle = coramp.colour('lane');
      ctx.fillRect(bbox.left, top, bbox.width, bottom - top);
    });
  }

  draw(u) {
    const { min, max } = u.scales.x;
    const seen = this.run.everyone.filter(
      (i) => coramp.entry(this.run, i) <= max && coramp.exit(this.run, i) >= min);
    this.clipped(u, (ctx) => {
      ctx.lineJoin = 'round';
      this.lapses(u, new Set(seen), coramp.FALLBACK, 'fallback', 6, []);
      for (const role of ['driver', 'automated', 'mainline', 'moved', 'ramp']) {
        for (const byRamp of [0, 1]) {
          const own = (i) => coramp.role(this.run, i) === role && this.run.on_ramp[i] === byRamp;
          this.stroke(u, seen.filter(own), role, byRamp ? 1.6 : 1);
        }
      }
      this.lapses(u, new Set(seen), coramp.UNKNOWN, 'page', 3, [2, 3]);
      (this.run.events ?? []).filter((e) => e.what === coramp.BREAKS_DOWN)
        .forEach((e) => this.part(u, e.vehicle, e.time, e.end ??= coramp.eventEnd(this.run, e), 'broken', 5, []));
      const marked = [...new Set([this.selected, this.hovered])].filter((i) => i !== null);
      marked.forEach((i) => this.stroke(u, [i], coramp.role(this.run, i), 4));
      this.marks(u, seen);
    });
  }

  stroke(u, vehicles, colour, width) {
    const { ctx } = u;
    ctx.strokeStyle = coramp.colour(colour);
    ctx.lineWidth = width * devicePixelRatio;
    ctx.beginPath();
    for (const i of vehicles) {
      if (!this.lines.has(i)) this.lines.set(i, coramp.line(this.run, i));
      this.lines.get(i).forEach(([t, s], k) => {
        const x = u.valToPos(t, 'x', true);
        const y = u.valToPos(s, 'y', true);
        if (k === 0) ctx.moveTo(x, y); else ctx.lineTo(x, y);
      });
    }
    ctx.stroke();
  }

  // Parts of lines in which vehicles fell back, or were not known.
  lapses(u, seen, bit, colour, width, dash) {
    const { min, max } = u.scales.x;
    coramp.lapses(this.run)
      .filter((lapse) => lapse.bit === bit && seen.has(lapse.vehicle) && lapse.from <= max && lapse.to >= min)
      .forEach(({ vehicle, from, to }) => this.part(u, vehicle, from, to, colour, width, dash));
  }

  part(u, i, from, to, colour, width, dash) {
    const { ctx } = u;
    const until = Math.min(to, coramp.exit(this.run, i));
    const steps = Math.max(1, Math.ceil((until - from) / 0.5));
    ctx.save();
    ctx.globalAlpha = colour === 'fallback' ? 0.55 : 1;
    ctx.strokeStyle = coramp.colour(colour);
    ctx.lineWidth = width * devicePixelRatio;
    ctx.setLineDash(dash.map((part) => part * devicePixelRatio));
    ctx.beginPath();
    for (let k = 0; k <= steps; k += 1) {
      const time = from + ((until - from) * k) / steps;
      const [x, y] = [u.valToPos(time, 'x', true), u.valToPos(coramp.state(this.run, i, time).station, 'y', true)];
      if (k === 0) ctx.moveTo(x, y); else ctx.lineTo(x, y);
    }
    ctx.stroke();
    ctx.restore();
  }

  // Merges as dots; violations as rings around the rear vehicle.
  marks(u, seen) {
    const { ctx } = u;
    const dot = (time, station, radius) => {
      ctx.beginPath();
      ctx.arc(u.valToPos(time, 'x', true), u.valToPos(station, 'y', true),
        radius * devicePixelRatio, 0, 2 * Math.PI);
    };
    ctx.fillStyle = coramp.colour('ramp');
    for (const i of seen) {
      const time = this.run.merge[i];
      if (!this.run.on_ramp[i] || time === null) continue;
      dot(time, coramp.state(this.run, i, time).station, 3);
      ctx.fill();
    }
    ctx.strokeStyle = coramp.colour('bad');
    ctx.lineWidth = 2.5 * devicePixelRatio;
    for (const { time, rear } of this.run.violations) {
      dot(time, coramp.state(this.run, rear, time).station, 7);
      ctx.stroke();
    }
  }
};

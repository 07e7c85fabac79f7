// How speeds and vehicles look from above, and the words for it.

// Colours from standing to v0, by share of v0; readers who see no red or green can tell them apart.
coramp.SPEED_COLOURS = [[0, [142, 11, 37]], [0.3, [222, 77, 44]], [0.55, [251, 171, 62]],
  [0.78, [250, 228, 120]], [0.9, [111, 176, 216]], [1, [47, 102, 179]]];
coramp.STOPPED_MPS = 1;
coramp.SLOW_SHARE = 0.75;
coramp.LONG_M = 10;

coramp.speedColour = (share) => {
  const at = Math.min(Math.max(share, 0), 1);
  const stops = coramp.SPEED_COLOURS;
  const next = Math.max(1, stops.findIndex(([place]) => place >= at));
  const [[low, from], [high, to]] = [stops[next - 1], stops[next]];
  const mixed = from.map((part, k) => Math.round(part + ((at - low) / (high - low)) * (to[k] - part)));
  return `rgb(${mixed.join()})`;
};

coramp.kmh = (mps) => `${(3.6 * mps).toFixed(0)} km/h`;

// What a vehicle on its lane would drive if nothing slowed it, in m/s.
coramp.usual = (run, onMainline) => (onMainline ? run.road.v0_mps : run.road.ramp_mps);

coramp.isSlow = (run, onMainline, speed) => speed < coramp.SLOW_SHARE * coramp.usual(run, onMainline);

// Whether a vehicle is a tractor with a trailer: by its type where that says so, else by its length.
coramp.isArticulated = (run, i) => {
  const type = run.type?.[i] ?? '';
  if (/bus|coach/i.test(type)) return false;
  return /truck|trailer|lorry/i.test(type) || run.length[i] > coramp.LONG_M;
};

// A vehicle whose front bumper is at 0, driving to the right; ``m`` is pixels a metre, ``high`` its
// width in pixels. The path is left open to be filled and stroked.
coramp.bodyOf = (ctx, run, i, m, high) => {
  const length = run.length[i] * m;
  const round = Math.min(0.25 * high, 3.5 * m);
  ctx.beginPath();
  if (coramp.isArticulated(run, i)) {
    const cab = Math.min(0.3 * length, 3 * m);
    const space = Math.max(0.6 * m, 1);
    ctx.roundRect(-length, -0.5 * high, length - cab - space, high, 0.08 * high);
    ctx.roundRect(-cab, -0.45 * high, cab, 0.9 * high, [0.1 * high, 0.3 * high, 0.3 * high, 0.1 * high]);
    ctx.rect(-cab - space, -0.12 * high, space, 0.24 * high);
  } else {
    ctx.roundRect(-length, -0.5 * high, length, high, [0.7 * round, round, round, 0.7 * round]);
  }
};

// Its windscreen, so that one sees which way it drives.
coramp.windscreen = (ctx, run, i, m, high) => {
  const cab = coramp.isArticulated(run, i);
  const back = cab ? 1.1 * m : Math.min(0.42 * run.length[i], 2.2) * m;
  ctx.beginPath();
  ctx.roundRect(-back, -0.36 * high, (cab ? 0.7 : 0.16 * run.length[i]) * m, 0.72 * high, 0.1 * high);
};

// Lanes as they lie: their marks, and on these the asphalt, in a colour by lane. ``toPx`` gives the
// pixels of a place, ``scale`` pixels a metre; no lane is narrower than ``least`` pixels.
coramp.drawLanes = (ctx, shapes, toPx, scale, colourOf, least = 0) => {
  const line = (shape, width, colour) => {
    ctx.strokeStyle = coramp.colour(colour);
    ctx.lineWidth = Math.max(width * scale, least);
    ctx.lineJoin = 'round';
    ctx.beginPath();
    for (let k = 0; k < shape.xy.length; k += 2) {
      const [x, y] = toPx({ x: shape.xy[k], y: shape.xy[k + 1] });
      if (k === 0) ctx.moveTo(x, y); else ctx.lineTo(x, y);
    }
    ctx.stroke();
  };
  shapes.forEach((shape) => line(shape, shape.width + 0.5, 'mark'));
  shapes.forEach((shape) => line(shape, shape.width - 0.3, colourOf(shape)));
};

// The legend of the replay; ``run`` says how fast one drives there.
coramp.replayLegend = (run, cooperative, mixed, runs = [run]) => {
  const { element } = coramp;
  const v0 = run.road.v0_mps;
  const ramp = coramp.SPEED_COLOURS.map(([place]) => `${coramp.speedColour(place)} ${100 * place}%`);
  const item = (kind, text) => element('li', {},
    element('span', { class: `mark ${kind}`, 'aria-hidden': 'true' }), text);
  const speeds = element('li', { class: 'speeds' }, 'speed: 0',
    element('span', { class: 'gradient', 'aria-hidden': 'true' }), coramp.kmh(v0));
  const bar = speeds.querySelector('.gradient');
  bar.style.background = `linear-gradient(to right, ${ramp.join()})`;
  const slow = coramp.SLOW_SHARE * v0;
  return element('ul', { class: 'legend' }, speeds,
    item('from-ramp', 'white dot: came by the ramp'),
    mixed ? item('automated', 'violet stripe: automated; the others have drivers') : null,
    item('slow', `red road: slow traffic (mainline below ${coramp.kmh(slow)})`),
    item('stopped', 'ring: stands'),
    ...coramp.knownLegend(runs, item),
    cooperative ? item('place', 'dashed: the place on the mainline that a ramp vehicle will take, and keep free') : null,
    item('safe', 'green ahead of a vehicle: its safe distance, red where it is nearer'));
};

// What of the legend is about a world that fails, where there is such a thing to see.
coramp.knownLegend = (runs, item) => {
  const heard = runs.find((run) => run.heard)?.heard;
  const broken = runs.some((run) => (run.events ?? []).some((e) => e.what === coramp.BREAKS_DOWN));
  const { element } = coramp;
  const crosses = () => element('li', {}, element('span', { class: 'mark lost lost-report', 'aria-hidden': 'true' }, '×'),
    element('span', { class: 'mark lost lost-command', 'aria-hidden': 'true' }, '×'), 'its report, its command is lost');
  return [
    broken ? item('broken', 'triangle: broken down') : null,
    heard ? item('known', 'dashed, with a bar: where the coordinator takes it to be, and where it may be by then') : null,
    heard ? item('unknown', `hollow, ?: not known to the coordinator (no report for ${heard.stale_s} s)`) : null,
    heard ? item('fallback', `thick outline, F: fallback, its last command is older than ${heard.valid_s} s`) : null,
    heard ? crosses() : null,
  ];
};

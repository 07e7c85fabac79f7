// Mainlines of several lanes: who is on which, and pictures in which each lane lies apart.
// Lane 0 is next to the ramp; -1 is the ramp with its acceleration lane.
coramp.CHANGE_S = 1.2;
coramp.MADE_WAY_S = 5;

coramp.lanesOf = (run) => run.road.lanes ?? 1;

// The lane that a vehicle is on, the one that it left before that, and when; of its stays in run.lanes.
coramp.stay = (run, i, time) => {
  const stays = run.lanes[i];
  let k = 0;
  while (k + 2 < stays.length && stays[k + 2] <= time) k += 2;
  return { lane: stays[k + 1], before: k > 0 ? stays[k - 1] : stays[k + 1], since: stays[k] };
};

// Where across the mainline a vehicle is drawn, in lanes: a change takes no time in the records, and a moment here.
coramp.across = ({ lane, before, since }, time) => {
  if (before < 0) return lane;
  const share = Math.min(1, (time - since) / coramp.CHANGE_S);
  return before + (lane - before) * share * share * (3 - 2 * share);
};

coramp.madeWayLately = (run, i, time) => (run.made_way ?? []).some(
  ([vehicle, when]) => vehicle === i && when <= time && time < when + coramp.MADE_WAY_S);

coramp.oneLane = { situation: coramp.situation, legend: coramp.legend, replayLegend: coramp.replayLegend };

coramp.situation = (run, time) => {
  if (coramp.lanesOf(run) === 1) return coramp.oneLane.situation(run, time);
  const lanes = { mainline: [], ramp: [] };
  for (const i of run.everyone) {
    if (coramp.entry(run, i) > time) break;
    if (coramp.exit(run, i) < time) continue;
    const stay = coramp.stay(run, i, time);
    const vehicle = { i, lane: stay.lane, across: coramp.across(stay, time), ...coramp.state(run, i, time) };
    lanes[stay.lane < 0 ? 'ramp' : 'mainline'].push(vehicle);
  }
  Object.values(lanes).forEach((vehicles) => {
    vehicles.sort((a, b) => b.station - a.station);
    const last = new Map();
    vehicles.forEach((vehicle) => {
      const front = last.get(vehicle.lane);
      vehicle.gap = front ? front.station - run.length[front.i] - vehicle.station : null;
      vehicle.needed = front ? coramp.safeDistance(run, front, vehicle) : null;
      last.set(vehicle.lane, vehicle);
    });
  });
  return lanes;
};

// Of several lanes the one next to the ramp lies lowest. A place on the mainline is told by 1 + its lane.
coramp.Road = class extends coramp.Road {
  get further() { return coramp.lanesOf(this.run) - 1; }

  resize(width, high) {
    const more = this.further * this.lane;
    this.rows.forEach((row, k) => { row.top += k * more; row.high += more; });
    super.resize(width, high + this.rows.length * more);
  }

  y(row, station, onMainline) {
    const lanes = onMainline ? 1 - Number(onMainline) : this.below(station);
    return row.top + coramp.Road.ABOVE_PX + (this.further + lanes + 0.5) * this.lane;
  }

  draw(time, look) {
    this.time = time;
    return super.draw(time, look);
  }

  each(row, lanes, act) {
    super.each(row, lanes, (vehicle, main) => act(vehicle, main && this.further ? 1 + vehicle.across : main));
  }

  drawRoad(ctx, row) {
    if (!this.further) { super.drawRoad(ctx, row); return; }
    const { start_m: start, end_m: end, ramp_start_m: ramp, lane_m: lane, decision_m: decision } = this.run.road;
    this.strip(ctx, row, [ramp, 0], false, this.lane, 'asphalt');
    this.strip(ctx, row, [0, lane], false, this.lane, 'asphalt-lane');
    for (let k = 0; k <= this.further; k += 1) this.strip(ctx, row, [start, end], 1 + k, this.lane + 0.5, 'asphalt');
    ctx.setLineDash([3 * this.scale, 3 * this.scale]);
    this.strip(ctx, row, [0, lane], 0.5, 1.5, 'mark');
    ctx.setLineDash([3 * this.scale, 6 * this.scale]);
    for (let k = 1; k <= this.further; k += 1) this.strip(ctx, row, [start, end], k + 0.5, 1, 'mark');
    ctx.setLineDash([]);
    if (this.run.decisions.length) {
      this.strip(ctx, row, [decision - 0.3, decision + 0.3], false, this.lane, 'quiet');
    }
  }

  // A frame around who made way, and the side to which it went.
  markVehicle(ctx, i, speed, high) {
    super.markVehicle(ctx, i, speed, high);
    if (!this.further || !coramp.madeWayLately(this.run, i, this.time)) return;
    const long = this.run.length[i] * this.scale;
    ctx.strokeStyle = coramp.colour('moved');
    ctx.lineWidth = 2.5;
    ctx.strokeRect(-long - 3, -0.5 * high - 3, long + 6, high + 6);
    ctx.fillStyle = coramp.colour('moved');
    ctx.beginPath();
    ctx.moveTo(-long - 6, 0.5 * high);
    ctx.lineTo(-long - 16, 0.5 * high);
    ctx.lineTo(-long - 11, -0.5 * high);
    ctx.fill();
  }
};

coramp.Replay = class extends coramp.Replay {
  counts(run, lanes) {
    const found = super.counts(run, lanes);
    const count = coramp.lanesOf(run);
    if (count === 1) return found;
    const by = Array.from({ length: count }, (_, k) => lanes.mainline.filter(({ lane }) => lane === k).length);
    const made = (run.made_way ?? []).filter(([, when]) => when <= this.time).length;
    return [`${found[0]} (${by.join(', ')} by lane, from the ramp on)`, ...found.slice(1),
      ...(run.made_way ? [`${made} made way so far`] : [])];
  }
};

// One lane is drawn in full, with the ramp where it is the lane next to that; all others are faint.
coramp.Diagram = class extends coramp.Diagram {
  static FAINT = 0.14;

  tools() {
    const tools = super.tools();
    const count = coramp.lanesOf(this.run);
    this.lane = count > 1 ? 0 : null;
    if (count === 1) return tools;
    const { element } = coramp;
    const names = ['ramp and lane next to it', ...Array.from({ length: count - 1 }, (_, k) => `lane ${k + 2} from the ramp`)];
    const select = element('select', { onchange: () => {
      this.lane = select.value === '' ? null : Number(select.value);
      this.plot.redraw(false);
    } }, ...names.map((name, k) => element('option', { value: k }, `${name}, others faint`)),
    element('option', { value: '' }, 'all lanes alike'));
    tools.append(element('label', {}, 'shown ', select));
    return tools;
  }

  isShown(i, time) {
    if (this.lane === null) return true;
    const { lane } = coramp.stay(this.run, i, time);
    return lane === this.lane || (this.lane === 0 && lane < 0);
  }

  stroke(u, vehicles, colour, width) {
    if (this.lane === null) { super.stroke(u, vehicles, colour, width); return; }
    const { ctx } = u;
    ctx.save();
    ctx.globalAlpha = coramp.Diagram.FAINT;
    super.stroke(u, vehicles, colour, width);
    ctx.restore();
    ctx.strokeStyle = coramp.colour(colour);
    ctx.lineWidth = width * devicePixelRatio;
    ctx.beginPath();
    for (const i of vehicles) {
      let before = null;
      for (const [t, s] of this.lines.get(i)) {
        const here = [u.valToPos(t, 'x', true), u.valToPos(s, 'y', true)];
        if (before !== null && this.isShown(i, 0.5 * (before.t + t))) {
          ctx.moveTo(...before.here);
          ctx.lineTo(...here);
        }
        before = { t, here };
      }
    }
    ctx.stroke();
  }

  nearest(left, top) {
    const { everyone } = this.run;
    const time = this.plot.posToVal(left, 'x');
    const there = everyone.filter((i) => coramp.isThere(this.run, i, time) && this.isShown(i, time));
    return super.nearest.call(Object.assign(Object.create(this), { run: { ...this.run, everyone: there } }), left, top);
  }

  // Who made way leaves the lane next to the ramp at a triangle.
  marks(u, seen) {
    super.marks(u, seen);
    const { ctx } = u;
    const size = 5 * devicePixelRatio;
    ctx.fillStyle = coramp.colour('moved');
    for (const [i, time] of this.run.made_way ?? []) {
      const [x, y] = [u.valToPos(time, 'x', true), u.valToPos(coramp.state(this.run, i, time).station, 'y', true)];
      ctx.beginPath();
      ctx.moveTo(x - size, y + size);
      ctx.lineTo(x + size, y + size);
      ctx.lineTo(x, y - size);
      ctx.fill();
    }
  }
};

coramp.lanesLegend = (list, runs, text) => {
  if (runs.some((run) => run.made_way)) {
    list.append(coramp.element('li', {}, coramp.element('span', { class: 'swatch moved', 'aria-hidden': 'true' }), text));
  }
  return list;
};

coramp.legend = (runs) => coramp.lanesLegend(coramp.oneLane.legend(runs), runs,
  'triangle: an automated vehicle made way, and left the lane next to the ramp for the one further in');

coramp.replayLegend = (run, cooperative, mixed, runs = [run]) => coramp.lanesLegend(
  coramp.oneLane.replayLegend(run, cooperative, mixed, runs), runs,
  `frame and arrow, for ${coramp.MADE_WAY_S} s: made way for one that merges`);

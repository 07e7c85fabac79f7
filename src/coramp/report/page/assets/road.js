// The road from above at any time of the records, in rows that are read like lines of a text.
// Lengths along the road are to scale. The ramp lies beside the mainline, a lane or two below it.
coramp.Road = class {
  static VIEWS = { merge: 'around the merge', whole: 'whole road', follow: 'follow the chosen vehicle' };
  static ABOVE_PX = 17;
  static BELOW_PX = 7;
  static LANE_PX = 17;
  static BODY = 0.58;
  static APART = 2.15;

  constructor(run, canvas) {
    this.run = run;
    this.canvas = canvas;
    this.view = 'merge';
    this.zoom = 1;
    this.centre = 0;
    this.seen = [];
  }

  // How many lanes a station of ramp or acceleration lane lies below the mainline.
  below(station) {
    const away = -this.run.road.beside_m - station;
    if (away <= 0) return 1;
    const share = Math.min(1, away / 45);
    return 1 + (coramp.Road.APART - 1) * share * share * (3 - 2 * share);
  }

  // Stations shown, in m.
  range(width) {
    const { start_m: start, end_m: end, lane_m: lane, ramp_start_m: ramp } = this.run.road;
    if (this.view === 'whole') return [Math.min(start, ramp), end];
    if (this.view === 'follow') {
      const half = (0.5 * width) / this.wanted(width);
      return [this.centre - half, this.centre + half];
    }
    return [Math.max(start, -0.6 * lane - 40), Math.min(end, lane + 60)];
  }

  // Pixels a metre that are wanted for vehicles to be seen.
  wanted(width) {
    const near = width < 700 ? 3.4 : 5;
    return this.zoom * { merge: near, whole: 0.55 * near, follow: 1.6 * near }[this.view];
  }

  // Rows of the road with their stations and where they lie on the page, in pixels.
  layOut() {
    const { ABOVE_PX, BELOW_PX, LANE_PX } = coramp.Road;
    const width = this.canvas.clientWidth || 1;
    const [from, to] = this.range(width);
    const count = Math.max(1, Math.ceil(((to - from) * this.wanted(width)) / width - 0.2));
    const each = (to - from) / count;
    this.scale = width / each;
    this.lane = Math.max(LANE_PX, this.run.road.lane_width_m * Math.min(this.scale, 8));
    let top = 0;
    this.rows = Array.from({ length: count }, (_, k) => {
      const start = from + k * each;
      const lanes = start < this.run.road.lane_m ? 1 + this.below(start) : 1;
      const row = { from: start, to: start + each, top, high: ABOVE_PX + lanes * this.lane + BELOW_PX };
      top += row.high;
      return row;
    });
    this.resize(width, top);
  }

  resize(width, high) {
    this.ratio = window.devicePixelRatio || 1;
    const style = `${high}px`;
    if (this.canvas.style.height !== style) this.canvas.style.height = style;
    const [w, h] = [Math.round(width * this.ratio), Math.round(high * this.ratio)];
    if (this.canvas.width !== w || this.canvas.height !== h) Object.assign(this.canvas, { width: w, height: h });
  }

  x(row, station) { return (station - row.from) * this.scale; }

  y(row, station, onMainline) {
    const lanes = onMainline ? 0 : this.below(station);
    return row.top + coramp.Road.ABOVE_PX + (lanes + 0.5) * this.lane;
  }

  draw(time, { distances, selected, hovered }) {
    const lanes = coramp.situation(this.run, time);
    this.follow(lanes, selected);
    this.layOut();
    const ctx = this.canvas.getContext('2d');
    ctx.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    ctx.clearRect(0, 0, this.canvas.width, this.canvas.height);
    this.seen = [];
    const pending = this.pending(time);
    const broken = coramp.brokenDown(this.run, time);
    this.known = new Map([...lanes.mainline, ...lanes.ramp].map(({ i }) => [i, coramp.known(this.run, i, time)]));
    for (const row of this.rows) {
      ctx.save();
      ctx.beginPath();
      ctx.rect(0, row.top, this.canvas.clientWidth, row.high);
      ctx.clip();
      this.drawRoad(ctx, row);
      this.drawStations(ctx, row);
      this.each(row, lanes, (vehicle, main) => this.drawSlow(ctx, row, vehicle, main));
      if (distances) this.each(row, lanes, (vehicle, main) => this.drawDistance(ctx, row, vehicle, main));
      pending.forEach((decision) => this.drawPlace(ctx, row, decision, time, [selected, hovered]));
      this.each(row, lanes, (vehicle, main) => this.drawVehicle(ctx, row, vehicle, main, selected));
      this.each(row, lanes, (vehicle) => {
        const known = this.known.get(vehicle.i);
        if (coramp.isOff(known)) coramp.drawKnown(ctx, this, row, vehicle, known);
      });
      this.each(row, lanes, (vehicle, main) => coramp.drawSigns(
        ctx, this, row, vehicle, main, this.known.get(vehicle.i), broken.has(vehicle.i)));
      this.each(row, lanes, (vehicle, main) => {
        if ([selected, hovered].includes(vehicle.i)) this.name(ctx, row, vehicle, main);
      });
      ctx.restore();
    }
    return lanes;
  }

  // Where the view is that goes along: with the chosen vehicle, or the foremost on the ramp.
  follow(lanes, selected) {
    if (this.view !== 'follow') return;
    const everyone = [...lanes.ramp, ...lanes.mainline];
    const found = everyone.find((v) => v.i === selected) ?? (selected === null ? everyone[0] : null);
    if (found) this.centre = found.station;
  }

  each(row, lanes, act) {
    for (const [lane, vehicles] of Object.entries(lanes)) {
      for (const vehicle of vehicles) {
        const rear = vehicle.station - this.run.length[vehicle.i];
        if (vehicle.station > row.from - 40 && rear < row.to + 5) act(vehicle, lane === 'mainline');
      }
    }
  }

  strip(ctx, row, [from, to], onMainline, width, colour) {
    ctx.strokeStyle = coramp.colour(colour);
    ctx.lineWidth = width;
    ctx.beginPath();
    const [first, last] = [Math.max(from, row.from - 2), Math.min(to, row.to + 2)];
    if (last <= first) return;
    const steps = onMainline ? 1 : Math.ceil((last - first) / 3);
    for (let k = 0; k <= steps; k += 1) {
      const station = first + ((last - first) * k) / steps;
      const [x, y] = [this.x(row, station), this.y(row, station, onMainline)];
      if (k === 0) ctx.moveTo(x, y); else ctx.lineTo(x, y);
    }
    ctx.stroke();
  }

  drawRoad(ctx, row) {
    const road = this.run.road;
    this.strip(ctx, row, [road.ramp_start_m, 0], false, this.lane, 'asphalt');
    this.strip(ctx, row, [0, road.lane_m], false, this.lane, 'asphalt-lane');
    this.strip(ctx, row, [road.start_m, road.end_m], true, this.lane, 'asphalt');
    ctx.strokeStyle = coramp.colour('mark');
    ctx.lineWidth = 1.5;
    ctx.setLineDash([3 * this.scale, 3 * this.scale]);
    const edge = row.top + coramp.Road.ABOVE_PX + this.lane;
    ctx.beginPath();
    ctx.moveTo(this.x(row, 0), edge);
    ctx.lineTo(this.x(row, road.lane_m), edge);
    ctx.stroke();
    ctx.setLineDash([]);
    this.strip(ctx, row, [road.decision_m - 0.3, road.decision_m + 0.3], false, this.lane, 'quiet');
  }

  // Stations above the road, and what is at them.
  drawStations(ctx, row) {
    const road = this.run.road;
    const every = this.scale > 3 ? 50 : 100;
    const named = new Map([[0, 'nose'], [road.lane_m, 'lane ends']]);
    if (this.run.decisions.length) named.set(road.decision_m, 'decisions');
    ctx.font = '11px system-ui, sans-serif';
    ctx.fillStyle = coramp.colour('quiet');
    const places = new Set([...named.keys()]);
    for (let s = Math.ceil(row.from / every) * every; s < row.to; s += every) {
      if (![...named.keys()].some((place) => Math.abs(place - s) * this.scale < 90)) places.add(s);
    }
    for (const station of places) {
      const x = this.x(row, station);
      const text = `${station} m${named.has(station) ? ` ${named.get(station)}` : ''}`.replace('-', '−');
      const wide = ctx.measureText(text).width;
      if (station < row.from || x + 4 + wide > this.canvas.clientWidth) continue;
      ctx.fillRect(x, row.top + 4, 1, coramp.Road.ABOVE_PX - 4);
      ctx.fillText(text, x + 4, row.top + 13);
    }
    if (row === this.rows[0] && this.below(row.from) > 2 && row.from < road.lane_m) {
      ctx.fillText('↑ mainline   ↓ ramp', 6, this.y(row, row.from, true) + 1.15 * this.lane);
    }
  }

  // Decisions that are made but whose merge is still to come.
  pending(time) {
    return this.run.decisions.filter(
      (d) => d.merge_time !== null && d.time <= time && time < d.merge_time);
  }

  // The place that a ramp vehicle will take, as it comes along the mainline.
  drawPlace(ctx, row, decision, time, marked) {
    const front = decision.merge_station - this.run.road.v0_mps * (decision.merge_time - time);
    const length = this.run.length[decision.vehicle];
    const clear = Math.max(0, 0.5 * (decision.required_gap - length));
    const [from, to] = [front - length - clear, front + clear];
    if (to < row.from || from > row.to) return;
    const high = 0.86 * this.lane;
    const y = this.y(row, 0, true);
    ctx.strokeStyle = coramp.colour('text');
    ctx.lineWidth = marked.includes(decision.vehicle) ? 2.5 : 1.3;
    ctx.setLineDash([4, 3]);
    ctx.strokeRect(this.x(row, from), y - 0.5 * high, (to - from) * this.scale, high);
    ctx.setLineDash([]);
    if (marked.includes(decision.vehicle)) {
      this.tag(ctx, row, `place of ${this.run.ids[decision.vehicle]}`, this.x(row, front), y);
    }
  }

  // The road of a slow vehicle, up to the one ahead where that is near.
  drawSlow(ctx, row, { i, station, speed, gap }, onMainline) {
    if (!coramp.isSlow(this.run, onMainline, speed)) return;
    const ahead = gap === null ? 4 : Math.min(Math.max(gap, 0), 25);
    const road = this.run.road;
    const limits = onMainline ? [road.start_m, road.end_m] : [road.ramp_start_m, road.lane_m];
    const [from, to] = [station - this.run.length[i] - 4, station + ahead];
    this.strip(ctx, row, [Math.max(from, limits[0]), Math.min(to, limits[1])], onMainline, this.lane, 'slow');
  }

  drawDistance(ctx, row, { station, gap, needed }, onMainline) {
    if (needed === null) return;
    const to = station + Math.max(needed, 1.5 / this.scale);
    this.strip(ctx, row, [station, to], onMainline, 0.3 * this.lane, gap < needed ? 'bad' : 'safe');
  }

  drawVehicle(ctx, row, { i, station, speed }, onMainline, selected) {
    const [x, y] = [this.x(row, station), this.y(row, station, onMainline)];
    const back = station - this.run.length[i];
    const rise = y - this.y(row, back, onMainline);
    const high = coramp.Road.BODY * this.lane;
    if (station >= row.from && back <= row.to) {
      this.seen.push({ i, id: this.run.ids[i], station, px: x, py: y, row: this.rows.indexOf(row) });
    }
    ctx.save();
    ctx.translate(x, y);
    ctx.rotate(Math.atan2(rise, this.run.length[i] * this.scale));
    coramp.bodyOf(ctx, this.run, i, this.scale, high);
    const known = this.known.get(i);
    ctx.fillStyle = known?.unknown ? coramp.colour('page') : coramp.speedColour(speed / this.run.road.v0_mps);
    ctx.fill();
    if (known?.unknown) ctx.setLineDash([3, 2]);
    const edge = known?.unknown ? 'ghost' : 'outline';
    ctx.strokeStyle = coramp.colour(known?.fallback ? 'fallback' : edge);
    ctx.lineWidth = known?.fallback ? 3.5 : (i === selected ? 2.5 : 0.8);
    ctx.stroke();
    ctx.setLineDash([]);
    coramp.windscreen(ctx, this.run, i, this.scale, high);
    ctx.fillStyle = 'rgb(20 26 34 / 65%)';
    ctx.fill();
    this.markVehicle(ctx, i, speed, high);
    ctx.restore();
  }

  // A stripe for who is automated among drivers, a dot for who came by the ramp, a ring for who stands.
  markVehicle(ctx, i, speed, high) {
    if (this.run.automated?.[i]) {
      const long = this.run.length[i] * this.scale;
      ctx.beginPath();
      ctx.rect(-0.97 * long, -0.17 * high, 0.94 * long, 0.34 * high);
      ctx.fillStyle = coramp.colour('automated');
      ctx.fill();
      ctx.strokeStyle = '#ffffff';
      ctx.lineWidth = 1;
      ctx.stroke();
      ctx.strokeStyle = coramp.colour('outline');
    }
    const middle = -0.68 * this.run.length[i] * this.scale;
    const round = (radius) => {
      ctx.beginPath();
      ctx.arc(middle, 0, radius, 0, 2 * Math.PI);
    };
    if (this.run.on_ramp[i]) {
      round(0.23 * high);
      ctx.fillStyle = '#ffffff';
      ctx.fill();
      ctx.lineWidth = 1;
      ctx.stroke();
    }
    if (speed < coramp.STOPPED_MPS) {
      ctx.beginPath();
      ctx.arc(-0.5 * this.run.length[i] * this.scale, 0, 0.8 * high, 0, 2 * Math.PI);
      ctx.strokeStyle = coramp.colour('bad');
      ctx.lineWidth = 2.5;
      ctx.stroke();
    }
  }

  name(ctx, row, { i, station, speed }, onMainline) {
    const middle = station - 0.5 * this.run.length[i];
    this.tag(ctx, row, `${this.run.ids[i]}, ${coramp.kmh(speed)}`, this.x(row, middle),
      this.y(row, station, onMainline), onMainline);
  }

  // A line of text above what is at a place, or below it, within the picture.
  tag(ctx, row, text, x, y, above = true) {
    ctx.font = '600 12px system-ui, sans-serif';
    const wide = ctx.measureText(text).width + 8;
    const left = Math.min(Math.max(0, x - 0.5 * wide), this.canvas.clientWidth - wide);
    const top = above ? Math.max(row.top, y - 0.5 * this.lane - 15)
      : Math.min(row.top + row.high - 15, y + 0.5 * this.lane);
    ctx.fillStyle = coramp.colour('page');
    ctx.fillRect(left, top, wide, 15);
    ctx.fillStyle = coramp.colour('text');
    ctx.fillText(text, left + 4, top + 11.5);
  }

  // The vehicle at a place of the canvas, null where there is none; in pixels of the page.
  at(px, py) {
    const inside = ({ i, px: x, py: y }) => px <= x + 4
      && px >= x - this.run.length[i] * this.scale - 4 && Math.abs(py - y) < 0.6 * this.lane;
    return this.seen.find(inside)?.i ?? null;
  }
};

// The road of a network as it lies there, with the vehicles on its lanes.
coramp.Road = class extends coramp.Road {
  static BEHIND_M = 110;
  static BEYOND_M = 70;
  static TALL = 0.3;
  static LARGER = 1.35;

  get isMap() { return this.view === 'map' && this.run.road.shapes?.length > 0; }

  // A place on a lane: x, y (m) and the direction (rad) in which one drives there, null where there is none.
  place(lane, station) {
    const shape = this.run.road.shapes.find((s) => s.lane === lane && s.from <= station && station <= s.to);
    if (!shape) return null;
    const points = shape.points ??= Array.from({ length: shape.xy.length / 2 }, (_, k) => shape.xy.slice(2 * k, 2 * k + 2));
    const lengths = points.slice(1).map(([x, y], k) => Math.hypot(x - points[k][0], y - points[k][1]));
    let left = ((station - shape.from) / (shape.to - shape.from || 1)) * lengths.reduce((a, b) => a + b, 0);
    let k = 0;
    while (k < lengths.length - 1 && left > lengths[k]) { left -= lengths[k]; k += 1; }
    const [[x, y], [x1, y1]] = [points[k], points[k + 1]];
    const share = lengths[k] ? left / lengths[k] : 0;
    return { x: x + share * (x1 - x), y: y + share * (y1 - y), angle: Math.atan2(y1 - y, x1 - x) };
  }

  // The same of a vehicle, between two lanes while it changes.
  placeOf({ station, across, lane = 0 }, main) {
    if (!main) return this.place(-1, station);
    const at = across ?? lane;
    const [low, high] = [this.place(Math.floor(at), station), this.place(Math.ceil(at), station)];
    if (!low || !high) return low ?? high;
    const share = at - Math.floor(at);
    return { x: low.x + share * (high.x - low.x), y: low.y + share * (high.y - low.y), angle: low.angle };
  }

  // Fits what lies around the merge into the picture; of a ramp that comes from far below, its end.
  layOutMap() {
    const { BEHIND_M, BEYOND_M, TALL, LARGER } = coramp.Road;
    const { lane_m: end, shapes } = this.run.road;
    const width = this.canvas.clientWidth || 1;
    const long = (end + BEHIND_M + BEYOND_M) / this.zoom;
    this.scale = width / long;
    this.lane = LARGER * this.run.road.lane_width_m * this.scale;
    const left = 0.5 * (end + BEYOND_M - BEHIND_M) - 0.5 * long;
    const seen = shapes.filter((s) => s.lane !== null).flatMap((s) => Array.from({ length: s.xy.length / 2 },
      (_, k) => s.xy.slice(2 * k, 2 * k + 2))).filter(([x]) => x > left && x < left + long).map(([, y]) => y);
    const [low, high] = [Math.max(Math.min(-10, ...seen) - 8, (-TALL * long) / this.zoom), Math.max(...seen, 10) + 8];
    const tall = (high - low) * this.scale;
    this.toPx = ({ x, y }) => [(x - left) * this.scale, (high - y) * this.scale];
    this.rows = [{ from: -Infinity, to: Infinity, top: 0, high: tall }];
    this.resizeMap(width, tall);
  }

  resizeMap(width, tall) {
    this.ratio = window.devicePixelRatio || 1;
    this.canvas.style.height = `${tall}px`;
    const [w, h] = [Math.round(width * this.ratio), Math.round(tall * this.ratio)];
    if (this.canvas.width !== w || this.canvas.height !== h) Object.assign(this.canvas, { width: w, height: h });
  }

  draw(time, look) {
    if (!this.isMap) return super.draw(time, look);
    this.time = time;
    this.seen = [];
    this.layOutMap();
    const lanes = coramp.situation(this.run, time);
    this.known = new Map([...lanes.mainline, ...lanes.ramp].map(({ i }) => [i, coramp.known(this.run, i, time)]));
    const ctx = this.canvas.getContext('2d');
    ctx.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    ctx.clearRect(0, 0, this.canvas.width, this.canvas.height);
    this.drawShapes(ctx);
    for (const [main, vehicles] of [[false, lanes.ramp], [true, lanes.mainline]]) {
      vehicles.forEach((vehicle) => this.drawOnMap(ctx, vehicle, main, look));
    }
    return lanes;
  }

  drawShapes(ctx) {
    coramp.drawLanes(ctx, this.run.road.shapes, this.toPx, this.scale,
      (shape) => (shape.lane === -1 && shape.from >= 0 ? 'asphalt-lane' : 'asphalt'));
  }

  x(row, station) { return this.atOrigin ? 0 : super.x(row, station); }

  y(row, station, onMainline) { return this.atOrigin ? 0 : super.y(row, station, onMainline); }

  drawOnMap(ctx, vehicle, main, { selected, hovered }) {
    const place = this.placeOf(vehicle, main);
    if (place === null) return;
    const [px, py] = this.toPx(place);
    if (px < -50 || px > this.canvas.clientWidth + 50) return;
    ctx.save();
    ctx.translate(px, py);
    ctx.rotate(-place.angle);
    this.atOrigin = true;
    this.drawVehicle(ctx, this.rows[0], vehicle, main, selected);
    this.atOrigin = false;
    ctx.restore();
    Object.assign(this.seen.at(-1), { px, py });
    if ([selected, hovered].includes(vehicle.i)) {
      this.tag(ctx, this.rows[0], `${this.run.ids[vehicle.i]}, ${coramp.kmh(vehicle.speed)}`, px, py);
    }
  }
};

coramp.Replay = class extends coramp.Replay {
  buildControls() {
    super.buildControls();
    if (!this.runs.some((run) => run.road.shapes?.length)) return;
    this.views.append(coramp.element('option', { value: 'map' }, 'as it lies in the network'));
  }
};

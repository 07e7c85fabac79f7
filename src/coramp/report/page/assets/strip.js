// Below the time slider: what failed when, one line for each kind of it; a click goes there.
coramp.Strip = class {
  static LINE_PX = 13;
  static INSET_PX = 8;

  constructor(run, end, onseek) {
    this.run = run;
    this.end = end;
    this.lines = coramp.Strip.linesOf(run);
    const { element } = coramp;
    this.canvas = element('canvas', { class: 'strip', role: 'img',
      'aria-label': `What failed when, ${run.title}: ${this.lines.map(({ name }) => name).join(', ')}` });
    this.canvas.addEventListener('click', (event) => onseek(this.timeAt(event.offsetX)));
    this.names = element('div', { class: 'strip-names', 'aria-hidden': 'true' },
      ...this.lines.map(({ name, colour }) => {
        const own = element('span', {}, name);
        own.style.color = `var(--${colour})`;
        return own;
      }));
    new ResizeObserver(() => this.draw()).observe(this.canvas);
    matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => this.draw());
  }

  // What there is to show: a name, a colour, and counts by second or spans of time.
  static linesOf(run) {
    const lines = [];
    const events = run.events ?? [];
    if (events.length) {
      lines.push({ name: 'events', colour: 'broken',
        spans: events.map((e) => [e.time, e.end ??= coramp.eventEnd(run, e)]) });
    }
    const counts = run.heard?.counts ?? {};
    const named = { report_lost: ['lost reports', 'lost-report'], command_lost: ['lost commands', 'lost-command'],
      unknown: ['not known', 'ghost'], fallback: ['fallback', 'fallback'] };
    for (const [key, [name, colour]] of Object.entries(named)) {
      if (counts[key]?.some((count) => count > 0)) lines.push({ name, colour, counts: counts[key] });
    }
    return lines;
  }

  get isEmpty() { return this.lines.length === 0; }

  timeAt(px) {
    const wide = this.canvas.clientWidth - 2 * coramp.Strip.INSET_PX;
    return (Math.min(Math.max(px - coramp.Strip.INSET_PX, 0), wide) / wide) * this.end;
  }

  draw() {
    const { LINE_PX, INSET_PX } = coramp.Strip;
    const [width, high] = [this.canvas.clientWidth || 1, LINE_PX * this.lines.length];
    const ratio = window.devicePixelRatio || 1;
    this.canvas.style.height = `${high}px`;
    Object.assign(this.canvas, { width: Math.round(width * ratio), height: Math.round(high * ratio) });
    const ctx = this.canvas.getContext('2d');
    ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
    const second = (width - 2 * INSET_PX) / this.end;
    this.lines.forEach(({ colour, counts, spans }, k) => {
      const bottom = (k + 1) * LINE_PX - 1;
      ctx.fillStyle = coramp.colour('grid');
      ctx.fillRect(INSET_PX, bottom, width - 2 * INSET_PX, 1);
      ctx.fillStyle = coramp.colour(colour);
      (spans ?? []).forEach(([from, to]) =>
        ctx.fillRect(INSET_PX + from * second - 1, bottom - LINE_PX + 3, Math.max(3, (to - from) * second), LINE_PX - 4));
      const most = Math.max(1, ...(counts ?? []));
      (counts ?? []).forEach((count, at) => {
        const tall = count === 0 ? 0 : Math.max(2, (count / most) * (LINE_PX - 3));
        ctx.fillRect(INSET_PX + at * second, bottom - tall, Math.max(1, second), tall);
      });
    });
  }
};

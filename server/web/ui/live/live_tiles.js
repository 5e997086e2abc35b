// Live view: one binary websocket carries all cameras. Per view the newest picture is drawn next; nothing queues. What is
// not in sight is not asked for, and costs the server nothing.
const RETRY_MS = 1000, RENDER_MS = 250, STALE_MS = 2500, ARRIVALS = 12, TREND = 80, LOUPE_PX = 180, LOUPE_MS = 120;
const HALF_PERCENT = 50, NEAR_PERCENT = 10, SATURATED_PERCENT = 0.01;

export default {
  template: `
    <div class="live-box">
      <div v-if="full" class="live-tools" role="toolbar" aria-label="tools of the live view">
        <button type="button" v-for="tool in ['Cross-hair', 'Loupe 1:1']" :key="tool" :aria-pressed="tools[tool]" @click="tools[tool] = !tools[tool]">{{ tool }}</button>
        <span v-if="point" class="live-point">{{ views[point.number] }}: column {{ point.column }}, row {{ point.row }} px</span>
      </div>
      <div class="live-grid" :data-pictures="pictures">
        <figure v-for="(view, number) in views" :key="view" :aria-label="view" :ref="figure => figures[number] = figure" :data-number="number" class="live-tile">
          <div v-show="!wanted[number].folded" class="live-picture">
            <canvas :ref="canvas => canvases[number] = canvas" width="560" height="420" role="img" :aria-label="view + ' live view'" :class="{ old: shown[number].old }"
              :tabindex="full && tools['Loupe 1:1'] ? 0 : null" @mousemove="look($event, number)" @mouseleave="point = null" @keydown="step($event, number)"></canvas>
            <div v-if="full && tools['Cross-hair']" class="live-cross" role="img" :aria-label="view + ' cross-hair'"></div>
            <div v-if="!shown[number].caption" class="live-empty">{{ hint }}</div>
            <canvas v-if="full && tools['Loupe 1:1'] && point && point.number === number" ref="loupe" class="live-loupe" :width="size" :height="size" :style="place" role="img" :aria-label="view + ' loupe'"></canvas>
          </div>
          <div class="live-head">
            <div class="live-name">{{ view }}
              <span :class="['lamp', shown[number].lamp]" role="status" :aria-label="view + ' ' + texts[shown[number].lamp]"></span>
            </div>
            <div v-if="full" class="live-choice" role="group" :aria-label="view + ' picture'">
              <template v-if="!wanted[number].folded">
                <button type="button" v-for="exposure in ['a', 'b']" :key="exposure" :aria-pressed="wanted[number].exposure === exposure" :aria-label="view + ' exposure ' + exposure.toUpperCase()" @click="choose(number, { exposure })">{{ exposure.toUpperCase() }}</button>
                <button type="button" :aria-pressed="wanted[number].scale === 'auto'" :aria-label="view + ' stretched grey scale'" title="fixed: black is 0, white is full scale; stretched: from the darkest to the brightest grey value" @click="choose(number, { scale: wanted[number].scale === 'auto' ? 'full' : 'auto' })">{{ wanted[number].scale === 'auto' ? 'stretched' : 'fixed' }}</button>
              </template>
              <button type="button" :aria-pressed="wanted[number].folded" :aria-label="view + ' hidden'" title="A hidden view costs nothing" @click="choose(number, { folded: !wanted[number].folded })">{{ wanted[number].folded ? 'show' : 'hide' }}</button>
            </div>
          </div>
          <div :class="['live-caption', { missing: shown[number].missing }]" role="status" :aria-label="view + ' newest shot'">{{ wanted[number].folded ? 'hidden' : shown[number].caption }}</div>
          <div v-if="full && !wanted[number].folded" :class="['live-figures', { awaited: !shown[number].figures }]" role="group" :aria-label="view + ' figures'">
            <svg class="live-histogram" viewBox="0 0 64 24" preserveAspectRatio="none" role="img" :aria-label="view + ' histogram'">
              <title>Histogram of all pixels, from 0 to full scale; counts are logarithmic</title>
              <line x1="32" x2="32" y1="0" y2="24" class="half" /><path :d="shown[number].histogram" />
              <rect v-if="shown[number].saturated" x="63" width="1" y="0" height="24" class="full-scale" />
            </svg>
            <div class="live-level" :title="'Light: the grey value that a tenth of all pixels exceeds. The mark is half of the range, where the paper sets the background'">
              <div class="live-bar"><i :class="shown[number].near ? 'near' : 'far'" :style="{ width: shown[number].light + '%' }"></i><b></b></div>
              <span>light {{ shown[number].light?.toFixed(0) }} % <small>of range, half is the aim</small></span>
            </div>
            <span :class="{ alert: shown[number].saturated }" title="Pixels at the largest grey value of the sensor">saturated {{ shown[number].figures?.saturated_percent.toFixed(2) }} %</span>
            <div class="live-focus" title="Steepest edges: change of the grey value per pixel, in percent of the light. Higher is sharper; the line shows how it went">
              <svg viewBox="0 0 80 20" preserveAspectRatio="none" role="img" :aria-label="view + ' focus trend'"><path :d="shown[number].trend" /></svg>
              <span>{{ shown[number].focus }}</span>
            </div>
          </div>
        </figure>
      </div>
    </div>`,
  props: { views: Array, path: String, full: Boolean, shapes: Array, pixels: String, hint: String },
  data() {
    return {
      pictures: 0, point: null, size: LOUPE_PX, tools: { "Cross-hair": false, "Loupe 1:1": false },
      wanted: this.views.map(() => ({ exposure: "b", scale: "full", folded: false })),
      shown: this.views.map(() => ({ lamp: "off", caption: "" })),
      texts: { ok: "live", off: "no new picture", fault: "no connection" },
    };
  },
  computed: {
    place() {
      const { x, y, width } = this.point;
      return { left: `${x > width / 2 ? x - LOUPE_PX - 16 : x + 16}px`, top: `${Math.max(4, y - LOUPE_PX / 2)}px` };
    },
  },
  created() {
    this.canvases = [];
    this.figures = [];
    this.tiles = this.views.map(() => newTile());
    this.inSight = this.views.map(() => false);
    this.leaving = false;
    this.rendered = 0;
  },
  mounted() {
    this.observer = new IntersectionObserver((entries) => {
      for (const entry of entries) this.inSight[Number(entry.target.dataset.number)] = entry.isIntersecting;
      this.wish();
    });
    for (const figure of this.figures) this.observer.observe(figure);
    this.onSight = () => this.wish();
    document.addEventListener("visibilitychange", this.onSight);
    this.connect();
    this.watch = setInterval(() => this.render(), RENDER_MS);
  },
  unmounted() {
    this.leaving = true;
    this.observer.disconnect();
    document.removeEventListener("visibilitychange", this.onSight);
    clearInterval(this.watch);
    this.socket?.close();
  },
  methods: {
    connect() {
      const url = new URL(this.path, location.href);
      url.protocol = url.protocol.replace("http", "ws");
      this.socket = new WebSocket(url);
      this.socket.binaryType = "arraybuffer";
      this.socket.onopen = () => { this.said = undefined; this.wish(); };
      this.socket.onmessage = (event) => this.take(event.data);
      this.socket.onclose = () => { if (!this.leaving) setTimeout(() => this.leaving || this.connect(), RETRY_MS); };
    },
    wish() {
      const tiles = {};
      this.views.forEach((view, number) => {
        const { exposure, scale, folded } = this.wanted[number];
        if (!document.hidden && this.inSight[number] && !folded) tiles[view] = { exposure, scale };
      });
      const said = JSON.stringify(tiles);
      if (this.socket?.readyState !== WebSocket.OPEN || said === this.said) return;
      this.said = said;
      this.socket.send(said);
    },
    choose(number, change) {
      if (change.exposure) this.tiles[number].trend = [];
      Object.assign(this.wanted[number], change);
      this.wish();
      this.render();
    },
    take(message) {
      const head = new DataView(message), number = head.getUint8(0), jpeg = 3 + head.getUint16(1);
      const told = JSON.parse(new TextDecoder().decode(new Uint8Array(message, 3, jpeg - 3)));
      const tile = this.tiles[number], now = performance.now(), { exposure, scale } = this.wanted[number];
      if (told.tile.exposure !== exposure || told.tile.scale !== scale) return; // what was wished for before
      if (told.shot !== tile.told?.shot || told.age_s < (now - tile.seen) / 1000) {
        const goesOn = told.shot > (tile.told?.shot ?? -1); // else it is of another run or live view
        tile.arrivals = [...(goesOn ? tile.arrivals : []), now].slice(-ARRIVALS);
        const focus = told.exposures[exposure]?.focus_percent;
        tile.trend = [...(goesOn ? tile.trend : []), ...(focus == null ? [] : [focus])].slice(-TREND);
      }
      Object.assign(tile, { told, seen: now, waiting: new Uint8Array(message, jpeg) });
      if (now - this.rendered > RENDER_MS) this.render();
      if (!tile.busy) this.draw(number);
    },
    async draw(number) {
      const tile = this.tiles[number], canvas = this.canvases[number];
      tile.busy = true;
      try {
        while (tile.waiting && canvas) { // the newest that has come meanwhile
          const blob = new Blob([tile.waiting], { type: "image/jpeg" });
          tile.waiting = null;
          const bitmap = await createImageBitmap(blob);
          if (canvas.width !== bitmap.width || canvas.height !== bitmap.height) [canvas.width, canvas.height] = [bitmap.width, bitmap.height];
          canvas.getContext("2d").drawImage(bitmap, 0, 0);
          bitmap.close();
          this.pictures++;
        }
      } finally {
        tile.busy = false;
      }
      if (this.point?.number === number) this.enlarge();
    },
    render() {
      this.rendered = performance.now();
      const connected = this.socket?.readyState === WebSocket.OPEN;
      this.shown = this.tiles.map((tile, number) => shownOf(tile, this.wanted[number].exposure, connected, this.rendered));
    },
    look(event, number) {
      if (!this.full || !this.tools["Loupe 1:1"]) return;
      const box = event.target.getBoundingClientRect(), [rows, columns] = this.shapes[number];
      const x = event.clientX - box.left, y = event.clientY - box.top;
      this.point = { number, x, y, width: box.width, row: within(Math.floor(y / box.height * rows), rows), column: within(Math.floor(x / box.width * columns), columns) };
      this.enlarge();
    },
    step(event, number) {
      const way = { ArrowLeft: [0, -1], ArrowRight: [0, 1], ArrowUp: [-1, 0], ArrowDown: [1, 0] }[event.key];
      if (!way || !this.tools["Loupe 1:1"]) return;
      event.preventDefault();
      const [rows, columns] = this.shapes[number], box = event.target.getBoundingClientRect(), far = event.shiftKey ? 20 : 1;
      const from = this.point?.number === number ? this.point : { row: rows >> 1, column: columns >> 1 };
      const row = within(from.row + far * way[0], rows), column = within(from.column + far * way[1], columns);
      this.point = { number, row, column, width: box.width, x: (column + 0.5) / columns * box.width, y: (row + 0.5) / rows * box.height };
      this.enlarge();
    },
    async enlarge() {
      if (this.enlarging) { this.again = true; return; }
      this.enlarging = true;
      do {
        this.again = false;
        await this.$nextTick();
        const { number, row, column } = this.point ?? {}, canvas = [this.$refs.loupe].flat()[0];
        if (number === undefined || !canvas || !this.shown[number].figures) break;
        const { exposure, scale } = this.wanted[number];
        const answer = await fetch(`${this.pixels}/${this.views[number]}/${exposure}.png?row=${row}&column=${column}&size_px=${LOUPE_PX}&scale=${scale}`).catch(() => null);
        if (answer?.ok) {
          const bitmap = await createImageBitmap(await answer.blob());
          canvas.getContext("2d").drawImage(bitmap, 0, 0);
          bitmap.close();
        }
        await new Promise((resolve) => setTimeout(resolve, LOUPE_MS));
      } while (this.again && !this.leaving);
      this.enlarging = false;
    },
  },
};

function newTile() {
  return { told: null, seen: -Infinity, waiting: null, busy: false, arrivals: [], trend: [] };
}

function within(value, size) {
  return Math.max(0, Math.min(size - 1, value));
}

function shownOf(tile, exposure, connected, now) {
  const isNew = ageOf(tile, now) < STALE_MS / 1000, lamp = !connected ? "fault" : isNew ? "ok" : "off";
  if (!tile.told) return { lamp, caption: "" };
  const figures = tile.told.exposures[exposure], light = figures?.light_percent ?? 0;
  const missing = Object.values(tile.told.exposures).includes(null);
  return {
    lamp, missing, figures, light, old: lamp !== "ok", caption: captionOf(tile, now),
    near: Math.abs(light - HALF_PERCENT) <= NEAR_PERCENT,
    saturated: (figures?.saturated_percent ?? 0) >= SATURATED_PERCENT,
    histogram: figures ? histogramOf(figures.histogram) : "",
    trend: trendOf(tile.trend),
    focus: figures?.focus_percent == null ? "focus: no light" : `focus ${figures.focus_percent.toFixed(1)} %/px (best ${Math.max(...tile.trend).toFixed(1)})`,
  };
}

function ageOf(tile, now) {
  return (tile.told?.age_s ?? 0) + (now - tile.seen) / 1000;
}

function captionOf(tile, now) {
  const age = ageOf(tile, now), rate = rateOf(tile.arrivals, now);
  const exposures = Object.entries(tile.told.exposures).map(([name, figures]) => name.toUpperCase() + (figures === null
    ? " missing"
    : ` ${figures.light_percent.toFixed(0)} %` + (figures.saturated_percent > 0 ? `, ${figures.saturated_percent.toFixed(2)} % saturated` : "")));
  return [`shot ${tile.told.shot}`, `${agedOf(age)} old`, ...exposures, ...(rate ? [`${rate.toFixed(1)} Hz`] : [])].join(" · ");
}

// The first seconds count by tenths; what is old by minutes and hours.
function agedOf(age) {
  if (age < 100) return `${age.toFixed(1)} s`;
  return age < 6000 ? `${Math.floor(age / 60)} min` : `${Math.floor(age / 3600)} h`;
}

// Pictures that came per second; none once they stay away.
function rateOf(arrivals, now) {
  if (arrivals.length < 3) return 0;
  const last = arrivals.at(-1), period = (last - arrivals[0]) / (arrivals.length - 1);
  return now - last > 2.5 * period + STALE_MS ? 0 : 1000 / period;
}

function histogramOf(counts) {
  const heights = counts.map((count) => Math.log1p(count)), top = Math.max(...heights, 1);
  return "M0 24" + heights.map((height, bin) => `V${(24 - 23 * height / top).toFixed(1)}H${bin + 1}`).join("") + "V24Z";
}

function trendOf(values) {
  if (values.length < 2) return "";
  const top = Math.max(...values), low = Math.min(...values), span = Math.max(top - low, 0.05 * top, 1e-6);
  return "M" + values.map((value, step) => `${(80 * step / (values.length - 1)).toFixed(1)} ${(18 - 16 * (value - low) / span).toFixed(1)}`).join("L");
}

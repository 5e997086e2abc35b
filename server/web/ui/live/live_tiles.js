// Live view: one binary websocket carries all cameras. Per view the newest picture wins; nothing queues.
export default {
  template: `
    <div class="live-grid" :data-pictures="pictures">
      <figure v-for="(view, number) in views" :key="view" class="live-tile">
        <canvas :ref="canvas => canvases[number] = canvas" width="560" height="420" role="img" :aria-label="view + ' live view'"></canvas>
        <figcaption>{{ view }}
          <span :class="['lamp', lamps[number]]" role="status" :aria-label="view + ' ' + texts[lamps[number]]"></span>
        </figcaption>
        <div :class="['live-caption', { missing: captions[number].missing }]" role="status" :aria-label="view + ' newest shot'">{{ captions[number].text }}</div>
      </figure>
    </div>`,
  props: { views: Array, path: String },
  data() {
    return { pictures: 0, lamps: this.views.map(() => "off"), captions: this.views.map(() => ({ text: "", missing: false })), texts: { ok: "live", off: "no new picture", fault: "no connection" } };
  },
  created() {
    this.canvases = [];
    this.busy = [];
    this.seen = this.views.map(() => -Infinity);
    this.told = this.views.map(() => null);
    this.leaving = false;
  },
  mounted() {
    this.connect();
    this.watch = setInterval(() => this.judge(), 500);
  },
  unmounted() {
    this.leaving = true;
    clearInterval(this.watch);
    this.socket?.close();
  },
  methods: {
    connect() {
      const url = new URL(this.path, location.href);
      url.protocol = url.protocol.replace("http", "ws");
      this.socket = new WebSocket(url);
      this.socket.binaryType = "arraybuffer";
      this.socket.onmessage = (event) => this.draw(event.data);
      this.socket.onclose = () => { if (!this.leaving) setTimeout(() => this.connect(), 1000); };
    },
    async draw(message) {
      const head = new DataView(message), number = head.getUint8(0), jpeg = 3 + head.getUint16(1);
      const canvas = this.canvases[number];
      this.seen[number] = performance.now();
      this.told[number] = JSON.parse(new TextDecoder().decode(new Uint8Array(message, 3, jpeg - 3)));
      this.captions[number] = this.captionOf(number);
      if (!canvas || this.busy[number]) return;
      this.busy[number] = true;
      try {
        const bitmap = await createImageBitmap(new Blob([new Uint8Array(message, jpeg)], { type: "image/jpeg" }));
        if (canvas.width !== bitmap.width || canvas.height !== bitmap.height) [canvas.width, canvas.height] = [bitmap.width, bitmap.height];
        canvas.getContext("2d").drawImage(bitmap, 0, 0);
        bitmap.close();
        this.pictures++;
      } finally {
        this.busy[number] = false;
      }
    },
    captionOf(number) {
      const told = this.told[number];
      if (!told) return { text: "", missing: false };
      const age = told.age_s + (performance.now() - this.seen[number]) / 1000;
      const exposures = Object.entries(told.exposures).map(([name, level]) => name.toUpperCase() + (level === null
        ? " missing"
        : ` ${level.light_percent.toFixed(0)} %` + (level.saturated_percent > 0 ? `, ${level.saturated_percent.toFixed(2)} % saturated` : "")));
      const text = [`shot ${told.shot}`, age < 100 ? `${age.toFixed(1)} s old` : "old", ...exposures].join(" · ");
      return { text, missing: Object.values(told.exposures).includes(null) };
    },
    judge() {
      this.captions = this.views.map((_, number) => this.captionOf(number));
      const connected = this.socket?.readyState === WebSocket.OPEN;
      this.lamps = this.seen.map((time) => !connected ? "fault" : performance.now() - time > 2500 ? "off" : "ok");
    },
  },
};

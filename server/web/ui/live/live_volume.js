// The newest shot of the live view in three slices that are linked. The page asks for the next volume once it has shown
// the last one, and only while it is in sight: nobody who does not look has it made.
const PAUSE_MS = 100, IDLE_MS = 1000, AXES = ["z", "y", "x"], ACROSS = { z: ["x", "y"], y: ["x", "z"], x: ["z", "y"] };

export default {
  template: `
    <div ref="box" class="volume-box">
      <div class="volume-told" role="status" aria-label="live volume">{{ text }}</div>
      <div v-if="problem" class="refusal" role="note" aria-label="why there is no newer volume">{{ problem }}</div>
      <div v-show="view.number" class="volume-slices" :style="{ gridTemplateColumns: columns }">
        <figure v-for="axis in axes" :key="axis">
          <figcaption>{{ axis }} = {{ place(axis).toFixed(2) }} mm <small>{{ across[axis][0] }} →, {{ across[axis][1] }} ↓</small></figcaption>
          <div class="volume-plane">
            <canvas :ref="canvas => canvases[axis] = canvas" role="img" :aria-label="'live slice ' + axis"></canvas>
            <i class="down" :style="{ left: percent(across[axis][0]) }"></i><i class="right" :style="{ top: percent(across[axis][1]) }"></i>
          </div>
          <input type="range" min="0" :max="last(axis)" v-model.number="index[axis]" :aria-label="'place of live slice ' + axis" @input="moved = axis">
        </figure>
      </div>
    </div>`,
  props: { path: String },
  data() {
    return { axes: AXES, across: ACROSS, view: { number: 0 }, index: { z: 0, y: 0, x: 0 }, text: "", problem: "", volumes: [] };
  },
  computed: {
    columns() { // all slices to one scale
      return AXES.map((axis) => `minmax(0,${this.last(ACROSS[axis][0]) + 1}fr)`).join(" ");
    },
  },
  created() {
    this.canvases = {};
    this.shown = 0;
  },
  mounted() {
    this.observer = new IntersectionObserver(([entry]) => { this.inSight = entry.isIntersecting; });
    this.observer.observe(this.$refs.box);
    this.$refs.box.scrollIntoView({ block: "nearest" }); // who switches it on wants to see it
    this.follow();
  },
  unmounted() {
    this.leaving = true;
    this.observer.disconnect();
  },
  methods: {
    last(axis) {
      return (this.view.shape?.[AXES.indexOf(axis)] ?? 1) - 1;
    },
    place(axis) {
      return (this.view.origin_mm?.["xyz".indexOf(axis)] ?? 0) + this.index[axis] * (this.view.pitch_mm ?? 0);
    },
    percent(axis) {
      return `${100 * (this.index[axis] + 0.5) / (this.last(axis) + 1)}%`;
    },
    async follow() {
      while (!this.leaving) {
        if (this.inSight && !document.hidden) await this.turn().catch(() => { this.text = "no answer"; });
        await new Promise((resolve) => setTimeout(resolve, this.inSight && !this.problem ? PAUSE_MS : IDLE_MS));
      }
    },
    async turn() {
      const view = await (await fetch(this.path, { cache: "no-store" })).json(), before = this.view;
      if (this.leaving) return;
      this.view = view;
      this.problem = view.problem ? `${view.problem} (${view.remedy})` : "";
      if (view.number && String(view.shape) !== String(before.shape)) for (const axis of AXES) this.index[axis] = this.last(axis) >> 1;
      const isNew = view.number !== this.shown, moved = this.moved;
      this.moved = "";
      if (view.number && (isNew || moved)) await Promise.all((isNew ? AXES : [moved]).map((axis) => this.draw(axis)));
      if (isNew) this.volumes = [...this.volumes, performance.now()].slice(-6);
      this.shown = view.number;
      this.text = this.told();
    },
    async draw(axis) {
      const answer = await fetch(`${this.path}/slices/${axis}/${Math.min(this.index[axis], this.last(axis))}.png`, { cache: "no-store" });
      const canvas = this.canvases[axis];
      if (!answer.ok || !canvas) return;
      const bitmap = await createImageBitmap(await answer.blob());
      [canvas.width, canvas.height] = [bitmap.width, bitmap.height];
      canvas.getContext("2d").drawImage(bitmap, 0, 0);
      bitmap.close();
    },
    told() {
      const { number, shot, age_s, calibration, took_s } = this.view;
      if (!number) return "no volume yet";
      const times = this.volumes, rate = times.length > 2 && !this.problem ? ` · ${(1000 * (times.length - 1) / (times.at(-1) - times[0])).toFixed(1)} Hz` : "";
      return `shot ${shot} · ${age_s < 100 ? `${age_s.toFixed(1)} s old` : "old"} · MLOS at half resolution · calibration ${calibration} · took ${took_s.toFixed(2)} s${rate}`;
    },
  },
};

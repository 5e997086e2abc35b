// A slice of a volume: its preview at once, full resolution as soon as that is there, axes in mm, a cross-hair to be dragged.
const LEFT = 46, RIGHT = 10, TOP = 8, BOTTOM = 34;

export default {
  template: `
    <figure ref="box" class="slice-view" role="img" :aria-label="label" :data-at="at.join(' ')">
      <svg v-if="width > 0" :width="width" :height="height" @pointerdown="press" @pointermove="drag" @pointerup="held = false" @pointercancel="held = false">
        <defs><clipPath :id="clip"><rect v-bind="plot" /></clipPath></defs>
        <rect v-bind="plot" class="slice-ground" />
        <g :clip-path="'url(#' + clip + ')'">
          <g v-for="layer in layers" :key="layer.key" :class="{ blended: layers.length > 1 }">
            <image v-if="layer.preview" :href="layer.preview" v-bind="placed(layer.preview_mm)" preserveAspectRatio="none" class="coarse" />
            <image v-if="layer.full" :key="layer.full" :href="layer.full" v-bind="placed(layer.full_mm)" preserveAspectRatio="none" />
          </g>
          <rect v-if="framed" v-bind="placed(framed)" class="slice-frame" />
          <circle v-for="(dot, number) in dots" :key="number" :cx="x(dot[0])" :cy="y(dot[1])" :r="dot[2]" :class="['slice-dot', dot[3]]" />
          <line :x1="x(at[0])" :x2="x(at[0])" :y1="plot.y" :y2="plot.y + plot.height" class="slice-cross" />
          <line :x1="plot.x" :x2="plot.x + plot.width" :y1="y(at[1])" :y2="y(at[1])" class="slice-cross" />
        </g>
        <g v-for="tick in ticks[0]" :key="'h' + tick">
          <line :x1="x(tick)" :x2="x(tick)" :y1="plot.y + plot.height" :y2="plot.y + plot.height + 4" class="slice-tick" />
          <text :x="x(tick)" :y="plot.y + plot.height + 15" text-anchor="middle">{{ told(tick) }}</text>
        </g>
        <g v-for="tick in ticks[1]" :key="'v' + tick">
          <line :x1="plot.x - 4" :x2="plot.x" :y1="y(tick)" :y2="y(tick)" class="slice-tick" />
          <text :x="plot.x - 7" :y="y(tick) + 4" text-anchor="end">{{ told(tick) }}</text>
        </g>
        <text :x="plot.x + plot.width / 2" :y="height - 4" text-anchor="middle">{{ names[0] }} / mm</text>
        <text :transform="'translate(' + (plot.x - 34) + ' ' + (plot.y + plot.height / 2) + ') rotate(-90)'" text-anchor="middle">{{ names[1] }} / mm</text>
      </svg>
    </figure>`,
  props: { label: String, names: Array, range_mm: Array, ticks: Array, at: Array, layers: Array, dots: Array, framed: Array, tallest: Number },
  data: () => ({ width: 0, held: false, clip: "slice-" + Math.random().toString(36).slice(2) }),
  mounted() {
    this.watch = new ResizeObserver(() => { this.width = Math.floor(this.$refs.box.clientWidth); });
    this.watch.observe(this.$refs.box);
  },
  unmounted() { this.watch.disconnect(); },
  computed: {
    plot() {
      const [h, v] = this.range_mm, room = Math.max(40, this.width - LEFT - RIGHT);
      const scale = Math.min(room / (h[1] - h[0]), (this.tallest - TOP - BOTTOM) / (v[1] - v[0]));
      const width = scale * (h[1] - h[0]);
      return { x: LEFT + (room - width) / 2, y: TOP, width, height: scale * (v[1] - v[0]) };
    },
    height() { return Math.ceil(this.plot.height + TOP + BOTTOM); },
  },
  methods: {
    x(mm) { const [low, high] = this.range_mm[0]; return this.plot.x + this.plot.width * (mm - low) / (high - low); },
    y(mm) { const [low, high] = this.range_mm[1]; return this.plot.y + this.plot.height * (mm - low) / (high - low); },
    placed([h, v]) { return { x: this.x(h[0]), y: this.y(v[0]), width: this.x(h[1]) - this.x(h[0]), height: this.y(v[1]) - this.y(v[0]) }; },
    told: (tick) => String(+tick.toFixed(6)),
    press(event) {
      this.held = true;
      event.currentTarget.setPointerCapture(event.pointerId);
      this.drag(event);
    },
    drag(event) {
      if (!this.held) return;
      const box = event.currentTarget.getBoundingClientRect();
      const share = [(event.clientX - box.left - this.plot.x) / this.plot.width, (event.clientY - box.top - this.plot.y) / this.plot.height];
      this.$emit("pick", share.map((part, n) => this.range_mm[n][0] + Math.min(1, Math.max(0, part)) * (this.range_mm[n][1] - this.range_mm[n][0])));
    },
  },
};

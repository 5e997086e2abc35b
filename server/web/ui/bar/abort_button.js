// ABORT: plain requests on two ways, a port of its own and the server itself. The first answer counts, however late.
// What was confirmed is true of its moment: it goes before somebody takes it for the light of the next run.
const LIMIT_MS = 1000, CONFIRMED_MS = 10000, KEY = "F8";

export default {
  template: `
    <div class="abort">
      <span v-if="text" :class="['abort-answer', kind]" role="alert" aria-label="abort answer">{{ text }}</span>
      <button type="button" class="abort-button" aria-label="ABORT" aria-keyshortcuts="F8" title="Light off now, whatever runs" @click="abort">
        ABORT <kbd>F8</kbd>
      </button>
    </div>`,
  props: { port: Number, paths: Array },
  data() {
    return { text: "", kind: "" };
  },
  mounted() {
    this.clicks = 0;
    window.addEventListener("keydown", this.onKey, true);
  },
  unmounted() {
    window.removeEventListener("keydown", this.onKey, true);
  },
  methods: {
    onKey(event) {
      if (event.key !== KEY || event.repeat) return;
      event.preventDefault();
      this.abort();
    },
    async abort() {
      const click = ++this.clicks, began = performance.now();
      const show = (text, kind) => { if (click === this.clicks) [this.text, this.kind] = [text, kind]; };
      show("ABORT is on its way", "");
      const late = setTimeout(() => show("NOT DELIVERED: use the hardware stop", "bad"), LIMIT_MS);
      const own = `${location.protocol}//${location.hostname}:${this.port}`;
      const ways = [own + this.paths[0], this.paths[1]].map((url) => ask(url));
      try {
        const ended = await Promise.any(ways), took = (performance.now() - began) / 1000;
        show(`light off confirmed at ${new Date().toLocaleTimeString("en-GB")}${1000 * took > LIMIT_MS ? `, ${took.toFixed(1)} s after the click: ABORT was late, and counted` : ""}${ended}`, "good");
        setTimeout(() => show("", ""), CONFIRMED_MS);
      } catch (errors) {
        const refusal = errors.errors.find((error) => error.status)?.message;
        show(refusal ? `${refusal}: use the hardware stop` : "NOT DELIVERED: use the hardware stop", "bad");
      } finally {
        clearTimeout(late);
      }
    },
  },
};

async function ask(url) {
  const answer = await fetch(url, { method: "POST", cache: "no-store" }), said = await answer.json();
  if (!answer.ok) throw Object.assign(new Error(said.detail), { status: answer.status });
  return said.ended ? `; ended ${said.ended}` : "";
}

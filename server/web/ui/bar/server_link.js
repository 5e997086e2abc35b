// The pulse of the server, heard by a websocket of its own. Without it nothing is known: the page greys and all but ABORT
// locks. Soon after, the page's own socket is closed, so that nothing waits in it to be sent later.
const LIMIT_MS = 1000, RETRY_MS = 1000, LOST_MS = 3000, GIVE_UP_MS = 5000, LOOK_MS = 200;
const BEATS_PER_S = 4, STALE_S = 5, RELOAD_S = 10;
const KNOWN = "/api/rig/control";
const LOCKED = ".q-page-container, .lockable, [id^='q-portal']";

export default {
  template: `
    <div :class="['link', { lost: !linked }]" role="status" aria-label="connection">
      <span :class="['lamp', linked ? 'ok' : 'fault']"></span><span class="link-text">{{ text }}</span>
    </div>`,
  props: { path: String, shown: Number, state: String, place: String },
  data() {
    return { linked: true, text: "connected" };
  },
  mounted() {
    this.beat = 0;
    this.heard = performance.now();
    this.heardAt = new Date();
    this.attempts = new Map();
    window.desk = { ticket: () => ({ beat: this.beat, key: newKey(), form: shownForm() }) };
    this.look = () => this.judge();
    this.timer = setInterval(this.look, LOOK_MS);
    for (const event of ["visibilitychange", "pageshow", "online", "resume"]) document.addEventListener(event, this.look);
    window.addEventListener("online", this.look);
    this.connect();
  },
  unmounted() {
    clearInterval(this.timer);
    for (const socket of this.attempts.keys()) socket.close();
  },
  methods: {
    connect() {
      const url = new URL(this.path, location.href);
      url.protocol = url.protocol.replace("http", "ws");
      const socket = new WebSocket(url);
      this.attempts.set(socket, performance.now());
      this.tried = performance.now();
      socket.onmessage = (event) => this.hear(socket, Number(event.data));
      socket.onclose = () => this.attempts.delete(socket);
    },
    hear(socket, beat) {
      for (const other of this.attempts.keys()) if (other !== socket) leave(other);
      this.beat = beat;
      this.heard = performance.now();
      this.heardAt = new Date();
      if (!this.linked) this.judge();
    },
    judge() {
      const now = performance.now(), isHeard = now - this.heard < LIMIT_MS;
      if (!isHeard) {
        for (const [socket, began] of this.attempts) if (now - began > GIVE_UP_MS) socket.close();
        if (now - this.tried > RETRY_MS) {
          this.connect();
          askWhetherSignedIn();
        }
      }
      const page = window.socket;
      if (page && now - this.heard > LOST_MS && page.active) page.disconnect();
      if (page && isHeard && !page.active) {
        page.sendBuffer.length = 0; // nothing that was clicked is sent now
        page.io.opts.query.next_message_id = window.nextMessageId; // what was missed is sent again from here on
        page.connect();
      }
      // What the page shows comes another way, and tells its beat too: a page that hangs is as good as none.
      const behind = this.shown && isHeard ? (this.beat - this.shown) / BEATS_PER_S : 0;
      if (behind > RELOAD_S) location.reload();
      this.show(isHeard && Boolean(page?.connected) && behind < STALE_S);
    },
    show(linked) {
      this.linked = linked;
      this.text = linked ? "connected" : "no connection";
      const title = `${linked ? this.state : "UNKNOWN"} · ${this.place}`;
      if (this.place && document.title !== title) document.title = title;
      document.body.classList.toggle("unlinked", !linked);
      for (const part of document.querySelectorAll(LOCKED)) if (part.inert === linked) part.inert = !linked;
      const since = linked ? "" : `unknown since ${this.heardAt.toLocaleTimeString("en-GB")}`;
      for (const part of document.querySelectorAll(".rig-unknown")) if (part.textContent !== since) part.textContent = since;
    },
  },
};

// A server that was started again knows no session, and refuses every socket: it answers, and the page would wait for ever.
async function askWhetherSignedIn() {
  try {
    const answer = await fetch(KNOWN, { signal: AbortSignal.timeout(GIVE_UP_MS) });
    if (answer.status === 401) location.reload();
  } catch {
    // nobody is there
  }
}

// A socket that is closed before it is open is an error to the browser.
function leave(socket) {
  if (socket.readyState === WebSocket.OPEN) socket.close();
  else socket.onopen = () => socket.close();
}

function newKey() {
  return Array.from(crypto.getRandomValues(new Uint8Array(16)), (byte) => byte.toString(16).padStart(2, "0")).join("");
}

function shownForm() {
  return Object.fromEntries([...document.querySelectorAll("[data-draft]")].map((field) => [field.dataset.draft, field.value ?? ""]));
}

// Dark or light: as the system is, unless somebody chose otherwise in this browser.
const KEY = "tomoshadow-theme";
const system = () => (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light");

export default {
  template: `<button type="button" class="theme-button lockable" aria-label="dark or light" title="Dark or light" @click="turn">
    <i class="q-icon notranslate material-icons" aria-hidden="true">contrast</i></button>`,
  mounted() {
    this.system = matchMedia("(prefers-color-scheme: dark)");
    this.follow = () => this.show(localStorage.getItem(KEY) ?? system());
    this.system.addEventListener("change", this.follow);
    this.follow();
  },
  unmounted() {
    this.system.removeEventListener("change", this.follow);
  },
  methods: {
    show(shade) {
      setDark(shade === "dark"); // of NiceGUI
    },
    turn() {
      const shade = document.body.classList.contains("body--dark") ? "light" : "dark";
      if (shade === system()) localStorage.removeItem(KEY);
      else localStorage.setItem(KEY, shade);
      this.show(shade);
    },
  },
};

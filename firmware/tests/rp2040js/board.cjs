/* The real image in rp2040js: what an emulator by other people makes of it.
 *
 *     NODE_PATH=.../node_modules node board.cjs IMAGE.bin TRIGGER_PIN <STEPS >RESULT
 *
 * Starts at the second boot stage, because rp2040js has no flash behind the boot ROM's commands.
 * STEPS is a list in JSON, carried out in virtual time from power-up on:
 *     ["say", TEXT]        a line to the firmware at 115200 baud; waits for the line that it answers
 *     ["run", MS]          time passes
 *     ["pin", NUMBER, 0|1] level that the world gives to an input
 * RESULT has `replies`, `edges` ([cycle, pin, level] of every pin that moved, pin -1 is the inner trigger line), the
 * converter's registers at the last shot as `set_points`, and what became of the clock tree. */
"use strict";
const fs = require("node:fs");
const { RP2040, ConsoleLogger, LogLevel } = require("rp2040js");

const CYCLE_NS = 8;
const CYCLES_PER_MS = 125_000;
const BYTE_CYCLES = Math.floor((10 * CYCLES_PER_MS * 1000) / 115_200);
const REPLY_LIMIT_MS = 60;
const SLEEP_MAX_CYCLES = 2000;
const WAITS_FOR_PIN = 1;
const FLASH = 0x1000_0000;
const CHANNELS = 4;
const CONVERTER = 0x60; // its address
const FACTORY = 0x8000; // its registers after power-up: on, at 0 V
const BYTE_BITS = 9;
const READ = 1;

/* What rp2040js lacks: a flash behind commands, the frequency counter, here with a sound crystal, and the brown-out
 * detector. */
function addPeripherals(chip) {
  const CLOCKS = 0x40008, FC0_STATUS = 0x98, FC0_RESULT = 0x9c, PASSED = 0x11, RING_KHZ = 6500;
  const SUPPLY = 0x40064, BROWN_OUT = 0x04, AS_SET = 0xb1;
  addFlashCommands(chip);
  answerWith(chip.peripherals[SUPPLY], { [BROWN_OUT]: () => AS_SET });
  answerWith(chip.peripherals[CLOCKS], { [FC0_STATUS]: () => PASSED, [FC0_RESULT]: () => RING_KHZ * 32 });
}

/* Of the commands, reading alone; all others leave the line high. */
function addFlashCommands(chip) {
  const SSI = 0x18000, STATUS = 0x28, DATA = 0x60, READY = 0xe, HIGH = 0xff;
  const PINS = 0x40018, SELECT = 0x0c, RELEASED = 3 << 8;
  const READ_DATA = 0x03, HEADER_BYTES = 4;
  let sent = [];
  const answer = () => {
    const [command, upper, middle, lower] = sent;
    if (command !== READ_DATA || sent.length <= HEADER_BYTES) return HIGH;
    return chip.flash[((upper << 16) | (middle << 8) | lower) + sent.length - HEADER_BYTES - 1] ?? HIGH;
  };
  answerWith(chip.peripherals[SSI], { [STATUS]: () => READY, [DATA]: answer });
  onWrite(chip.peripherals[SSI], DATA, (value) => sent.push(value & 0xff));
  onWrite(chip.peripherals[PINS], SELECT, (value) => {
    if ((value & RELEASED) === RELEASED) sent = [];
  });
}

/* A write to the counter of SysTick lets it go on from its reload value; in rp2040js, from the largest. */
function reloadTicks(block) {
  const VALUE = 0x18;
  onWrite(block, VALUE, () => block.systickTimer.set(block.systickReload));
}

function onWrite(block, register, then) {
  const write = block.writeUint32.bind(block);
  block.writeUint32 = (offset, value) => {
    write(offset, value);
    if (offset === register) then(value);
  };
}

function answerWith(block, values) {
  const read = block.readUint32.bind(block);
  block.readUint32 = (offset) => values[offset]?.() ?? read(offset);
}

/* The MCP4728 that sets the currents: fast write, multi-write and read back of its four registers. */
class Converter {
  constructor(chip) {
    const bus = chip.i2c[0];
    this.registers = Array(CHANNELS).fill(FACTORY);
    this.written = [];
    this.unread = [];
    const alarm = chip.clock.createAlarm(() => this.next());
    const after = (bits, next) => {
      this.next = next;
      alarm.schedule(bits * (bus.sclHighPeriod + bus.sclLowPeriod) * CYCLE_NS);
    };
    bus.onStart = () => after(1, () => bus.completeStart());
    bus.onConnect = (address, mode) => {
      this.written = [];
      this.unread = mode === READ ? this.contents() : [];
      after(BYTE_BITS, () => bus.completeConnect(address === CONVERTER));
    };
    bus.onWriteByte = (value) => after(BYTE_BITS, () => bus.completeWrite(this.take(value)));
    bus.onReadByte = () => after(BYTE_BITS, () => bus.completeRead(this.unread.shift() ?? 0xff));
    bus.onStop = () => after(1, () => bus.completeStop());
  }

  contents() {
    return this.registers.flatMap((value, i) => [0xc0 | (i << 4), value >> 8, value & 0xff, 0xc8 | (i << 4), FACTORY >> 8, 0]);
  }

  take(value) {
    this.written.push(value);
    const { length } = this.written;
    const [upper, lower] = this.written.slice(-2);
    const fast = this.written[0] >> 5 <= 1;
    if (fast && length % 2 === 0)
      this.registers[length / 2 - 1] = (this.registers[length / 2 - 1] & 0x9000) | ((upper & 0x30) << 9) | ((upper & 0xf) << 8) | lower;
    if (!fast && length % 3 === 0) this.registers[(this.written.at(-3) >> 1) & 3] = (upper << 8) | lower;
    return fast || this.written[0] >> 5 === 2;
  }
}

class Board {
  constructor(image, triggerPin) {
    this.cycle = 0;
    this.edges = [];
    this.sent = [];
    this.trigger = false;
    this.triggerPin = triggerPin;
    this.chip = new RP2040();
    this.chip.logger = new ConsoleLogger(LogLevel.Error, true);
    this.chip.flash.set(image);
    addPeripherals(this.chip);
    reloadTicks(this.chip.ppb);
    this.chip.uart[0].onByte = (byte) => this.sent.push(byte);
    this.chip.gpio.forEach((pin, number) => pin.addListener((now, before) => this.onPin(number, now, before)));
    this.machines = this.chip.pio.flatMap((pio) => pio.machines.map((machine) => ({ machine, stalled: false })));
    this.converter = new Converter(this.chip);
    this.setPoints = [];
    for (const pio of this.chip.pio) pio.run = () => {}; // in a loop of its own, out of step with the processor
    this.chip.core.PC = FLASH;
  }

  onPin(number, now, before) {
    if ((now === 1) !== (before === 1)) this.edges.push([this.cycle, number, now === 1 ? 1 : 0]);
  }

  /* One cycle of every machine. The programs have no delays and no clock divider. A machine whose stall ended since
   * its last cycle, spends this one on the instruction at which it stood. */
  stepMachines() {
    for (const entry of this.machines) {
      const { machine } = entry;
      if (!machine.enabled) continue;
      if (machine.waiting) machine.checkWait();
      else if (!entry.stalled) machine.step();
      entry.stalled = machine.waiting;
    }
    for (const pio of this.chip.pio) pio.checkChangedPins();
  }

  /* rp2040js tells no machine of an input override; all see it in their next cycle. */
  watchTrigger() {
    const level = this.chip.gpio[this.triggerPin].inputValue;
    if (level !== this.trigger) {
      this.edges.push([this.cycle + 1, -1, level ? 1 : 0]);
      this.setPoints = [...this.converter.registers];
    }
    this.trigger = level;
  }

  get machinesRun() {
    return this.machines.some(
      ({ machine, stalled }) =>
        machine.enabled &&
        (!machine.waiting || stalled === false || (machine.waitType === WAITS_FOR_PIN && this.pinReleases(machine))),
    );
  }

  pinReleases(machine) {
    return this.chip.gpio[machine.waitIndex].inputValue === machine.waitPolarity;
  }

  advance(cycles) {
    this.watchTrigger();
    if (this.machinesRun) {
      for (let i = 0; i < cycles; i++) {
        this.cycle++;
        this.stepMachines();
      }
    } else {
      this.cycle += cycles;
    }
    this.chip.clock.tick(cycles * CYCLE_NS);
  }

  /* Up to a cycle, or until `done` says so while the processor sleeps. */
  run(untilCycle, done = () => false) {
    const { core, clock } = this.chip;
    while (this.cycle < untilCycle) {
      if (!core.waiting) {
        this.advance(core.executeInstruction());
        continue;
      }
      if (done()) return true;
      const alarm = Math.max(1, Math.ceil(clock.nanosToNextAlarm / CYCLE_NS));
      this.advance(this.machinesRun ? 1 : Math.min(alarm, untilCycle - this.cycle, SLEEP_MAX_CYCLES));
    }
    return false;
  }

  say(text) {
    this.sent = [];
    for (const byte of Buffer.from(text)) {
      this.chip.uart[0].feedByte(byte);
      this.run(this.cycle + BYTE_CYCLES);
    }
    const answered = () => this.sent.at(-1) === 0x0a;
    if (!this.run(this.cycle + REPLY_LIMIT_MS * CYCLES_PER_MS, answered)) throw new Error(`no answer to ${text}`);
    return Buffer.from(this.sent).toString();
  }

  clocks() {
    const { clocks, pllSys, uart, clkPeri } = this.chip;
    return {
      ref_hz: clocks.refFreq,
      sys_hz: clocks.sysFreq,
      peri_hz: clocks.periFreq,
      pll_hz: pllSys.frequency,
      uart_clock_hz: clkPeri,
      baud: uart[0].baudRate,
    };
  }
}

function main() {
  const [image, triggerPin] = process.argv.slice(2);
  const board = new Board(fs.readFileSync(image), Number(triggerPin));
  const replies = [];
  for (const [what, ...rest] of JSON.parse(fs.readFileSync(0, "utf8"))) {
    if (what === "say") replies.push(board.say(rest[0]));
    else if (what === "run") board.run(board.cycle + rest[0] * CYCLES_PER_MS);
    else board.chip.gpio[rest[0]].setInputValue(rest[1] === 1);
  }
  process.stdout.write(JSON.stringify({ replies, edges: board.edges, set_points: board.setPoints, clocks: board.clocks() }));
}

main();

/* The registers of the RP2040 that this port uses, by the names of its data sheet (build-date 2024-10-15). */
#ifndef RP2040_H
#define RP2040_H

#include <stdint.h>

#define REG(address) (*(volatile uint32_t *)(uintptr_t)(address))
/* A function that runs once, before interrupts do: it stays in flash, where reading may take its time. */
#define ONCE __attribute__((section(".flash_text"), noinline))
/* Atomic aliases of every peripheral register, section 2.1.2. */
#define REG_SET(address) REG((address) + 0x2000u)
#define REG_CLEAR(address) REG((address) + 0x3000u)

/* 2.14.3 */
#define RESETS_RESET 0x4000c000u
#define RESETS_DONE 0x4000c008u
enum reset_bits {
    RESET_I2C0 = 1 << 3,
    RESET_IO_BANK0 = 1 << 5,
    RESET_PADS_BANK0 = 1 << 8,
    RESET_PIO0 = 1 << 10,
    RESET_PIO1 = 1 << 11,
    RESET_PLL_SYS = 1 << 12,
    RESET_PLL_USB = 1 << 13,
    RESET_PWM = 1 << 14,
    RESET_TIMER = 1 << 21,
    RESET_UART0 = 1 << 22,
    RESET_USB = 1 << 24,
};

/* 2.13.5: power-on state machine, which the watchdog restarts */
#define PSM_WDSEL 0x40010008u

/* 2.15.7, 2.16.7, 2.18.4 */
#define CLK_REF_CTRL 0x40008030u
#define CLK_REF_SELECTED 0x40008038u
#define CLK_SYS_CTRL 0x4000803cu
#define CLK_SYS_SELECTED 0x40008044u
#define CLK_PERI_CTRL 0x40008048u
#define CLK_USB_CTRL 0x40008054u
#define CLK_SYS_RESUS_CTRL 0x40008078u
#define FC0_REF_KHZ 0x40008080u
#define FC0_MIN_KHZ 0x40008084u
#define FC0_MAX_KHZ 0x40008088u
#define FC0_INTERVAL 0x40008090u
#define FC0_SRC 0x40008094u
#define FC0_STATUS 0x40008098u
#define FC0_RESULT 0x4000809cu
#define XOSC_CTRL 0x40024000u
#define XOSC_STATUS 0x40024004u
#define XOSC_STARTUP 0x4002400cu
#define PLL_SYS 0x40028000u
#define PLL_USB 0x4002c000u
#define PLL_CS(pll) ((pll) + 0x0u)
#define PLL_PWR(pll) ((pll) + 0x4u)
#define PLL_FBDIV(pll) ((pll) + 0x8u)
#define PLL_PRIM(pll) ((pll) + 0xcu)
#define ROSC_RANDOMBIT 0x4006001cu

/* 2.19.6: pin n has a control register and a pad */
#define IO_CTRL(pin) (0x40014004u + 8u * (uint32_t)(pin))
#define IO_INTR(pin) (0x400140f0u + 4u * ((uint32_t)(pin) / 8u))
#define IO_INTE(pin) (0x40014100u + 4u * ((uint32_t)(pin) / 8u))
#define IO_INTS(pin) (0x40014120u + 4u * ((uint32_t)(pin) / 8u))
#define IO_EDGE_LOW(pin) (4u << (4u * ((uint32_t)(pin) % 8u)))
#define IO_EDGE_HIGH(pin) (8u << (4u * ((uint32_t)(pin) % 8u)))
#define PAD(pin) (0x4001c004u + 4u * (uint32_t)(pin))
#define IO_QSPI_SS_CTRL 0x4001800cu
#define SIO_GPIO_IN 0xd0000004u
#define SIO_GPIO_OUT_CLR 0xd0000018u
#define SIO_GPIO_OE_SET 0xd0000024u
#define SIO_GPIO_OE_CLR 0xd0000028u

/* 2.3.1.7 */
#define SIO_DIV_UDIVIDEND 0xd0000060u
#define SIO_DIV_UDIVISOR 0xd0000064u
#define SIO_DIV_QUOTIENT 0xd0000070u
#define SIO_DIV_REMAINDER 0xd0000074u
#define SIO_DIV_CSR 0xd0000078u
enum { SIO_DIV_READY = 1 << 0 };

enum io_ctrl {
    FUNCTION_UART = 2,
    FUNCTION_I2C = 3,
    FUNCTION_PWM = 4,
    FUNCTION_SIO = 5,
    FUNCTION_PIO0 = 6,
    FUNCTION_PIO1 = 7,
    FUNCTION_NONE = 31,
    OUTPUT_LOW = 2 << 8, /* OUTOVER: whatever the peripheral drives */
    OUTPUT_HIGH = 3 << 8,
    OUTPUT_ENABLE = 3 << 12, /* OEOVER */
    INPUT_LOW = 2 << 16,     /* INOVER: whatever the pin sees */
    INPUT_HIGH = 3 << 16,
};

enum pad {
    PAD_SCHMITT = 1 << 1,
    PAD_PULL_DOWN = 1 << 2,
    PAD_PULL_UP = 1 << 3,
    PAD_4_MA = 1 << 4,
    PAD_INPUT = 1 << 6,
};

/* 3.7: pio is 0 or 1 */
#define PIO(pio) (0x50200000u + 0x100000u * (uint32_t)(pio))
#define PIO_CTRL(pio) PIO(pio)
#define PIO_FSTAT(pio) (PIO(pio) + 0x04u)
#define PIO_TX_EMPTY(machine) (1u << (24u + (uint32_t)(machine)))
#define PIO_TXF(pio, machine) (PIO(pio) + 0x10u + 4u * (uint32_t)(machine))
#define PIO_INSTR_MEM(pio, index) (PIO(pio) + 0x48u + 4u * (uint32_t)(index))
#define PIO_CLKDIV(pio, machine) (PIO(pio) + 0xc8u + 0x18u * (uint32_t)(machine))
#define PIO_EXECCTRL(pio, machine) (PIO_CLKDIV(pio, machine) + 0x04u)
#define PIO_SHIFTCTRL(pio, machine) (PIO_CLKDIV(pio, machine) + 0x08u)
#define PIO_ADDR(pio, machine) (PIO_CLKDIV(pio, machine) + 0x0cu)
#define PIO_INSTR(pio, machine) (PIO_CLKDIV(pio, machine) + 0x10u)
#define PIO_PINCTRL(pio, machine) (PIO_CLKDIV(pio, machine) + 0x14u)

/* 4.1.3, 4.1.4: memory with setup packet, controls and buffers; direction 0 is out, from the host */
#define USB_SETUP_PACKET 0x50100000u
#define USB_ENDPOINT_CONTROL(endpoint, direction) \
    (0x50100000u + 8u * (uint32_t)(endpoint) + 4u * (1u - (uint32_t)(direction)))
#define USB_BUFFER_CONTROL(endpoint, direction) \
    (0x50100080u + 8u * (uint32_t)(endpoint) + 4u * (1u - (uint32_t)(direction)))
#define USB_BUFFERS 0x50100100u
#define USB_ADDR_ENDP 0x50110000u
#define USB_MAIN_CTRL 0x50110040u
#define USB_SIE_CTRL 0x5011004cu
#define USB_SIE_STATUS 0x50110050u
#define USB_BUFF_STATUS 0x50110058u
#define USB_EP_STALL_ARM 0x50110068u
#define USB_MUXING 0x50110074u
#define USB_PWR 0x50110078u
#define USB_INTE 0x50110090u
#define USB_INTF 0x50110094u
#define USB_INTS 0x50110098u
#define USB_ENDPOINT_ENABLE (1u << 31)
enum usb {
    USB_ENDPOINT_INTERRUPT = 1 << 29, /* for every buffer */
    USB_ENDPOINT_BULK = 2 << 26,
    USB_ENDPOINT_OF_INTERRUPTS = 3 << 26,
    USB_BUFFER_FULL = 1 << 15,
    USB_BUFFER_DATA1 = 1 << 13,
    USB_BUFFER_STALL = 1 << 11,
    USB_BUFFER_AVAILABLE = 1 << 10,
    USB_BUFFER_LENGTH = 0x3ff,
    USB_CONTROLLER_ENABLE = 1 << 0,
    USB_SIE_INTERRUPT_PER_BUFFER = 1 << 29, /* of endpoint 0 */
    USB_SIE_PULL_UP = 1 << 16,
    USB_SIE_BUS_RESET = 1 << 19,
    USB_SIE_SETUP = 1 << 17,
    USB_SIE_SUSPENDED = 1 << 4,
    USB_STALL_CONTROL = 3,
    USB_TO_PHY = 1 << 0,
    USB_SOFTCON = 1 << 3,
    USB_VBUS_DETECT = 1 << 3,
    USB_VBUS_OVERRIDE = 1 << 2,
    USB_INT_SETUP = 1 << 16,
    USB_INT_SUSPEND = 1 << 14,
    USB_INT_BUS_RESET = 1 << 12,
    USB_INT_BUFFER = 1 << 4,
};

/* 4.2.8 */
#define UART0_DR 0x40034000u
#define UART0_FR 0x40034018u
#define UART0_IBRD 0x40034024u
#define UART0_FBRD 0x40034028u
#define UART0_LCR_H 0x4003402cu
#define UART0_CR 0x40034030u
#define UART0_IMSC 0x40034038u
enum uart {
    UART_FR_RX_EMPTY = 1 << 4,
    UART_FR_TX_FULL = 1 << 5,
    UART_LCR_8_BITS = 3 << 5,
    UART_CR_ENABLE = 1 << 0 | 1 << 8 | 1 << 9, /* UART, transmitter, receiver */
    UART_INT_RX = 1 << 4,
    UART_DR_FRAMING = 1 << 8,
    UART_DR_BREAK = 1 << 10,
    UART_DR_OVERRUN = 1 << 11,
};

/* 4.3.17 */
#define I2C_CON 0x40044000u
#define I2C_TAR 0x40044004u
#define I2C_DATA_CMD 0x40044010u
#define I2C_FS_SCL_HCNT 0x4004401cu
#define I2C_FS_SCL_LCNT 0x40044020u
#define I2C_INTR_MASK 0x40044030u
#define I2C_RAW_INTR_STAT 0x40044034u
#define I2C_CLR_TX_ABRT 0x40044054u
#define I2C_ENABLE 0x4004406cu
#define I2C_STATUS 0x40044070u
#define I2C_SDA_HOLD 0x4004407cu
#define I2C_FS_SPKLEN 0x400440a0u
enum i2c {
    I2C_CON_MASTER = 1 << 0 | 2 << 1 | 1 << 5 | 1 << 6, /* master, fast mode, restarts, no slave */
    I2C_CMD_READ = 1 << 8,
    I2C_CMD_STOP = 1 << 9,
    I2C_INTR_TX_ABRT = 1 << 6,
    I2C_STATUS_TX_NOT_FULL = 1 << 1,
    I2C_STATUS_TX_EMPTY = 1 << 2,
    I2C_STATUS_RX_ANY = 1 << 3,
    I2C_STATUS_MASTER_ACTIVE = 1 << 5,
};

/* 4.5.3: slice n drives pins 2n and 2n + 1, modulo 16 */
#define PWM_CSR(slice) (0x40050000u + 0x14u * (uint32_t)(slice))
#define PWM_CC(slice) (PWM_CSR(slice) + 0x0cu)
#define PWM_TOP(slice) (PWM_CSR(slice) + 0x10u)

/* 4.6.5 */
#define TIMER_ALARM0 0x40054010u
#define TIMER_RAWH 0x40054024u
#define TIMER_RAWL 0x40054028u
#define TIMER_DBGPAUSE 0x4005402cu
#define TIMER_INTR 0x40054034u
#define TIMER_INTE 0x40054038u

/* 4.7.6 */
#define WATCHDOG_CTRL 0x40058000u
#define WATCHDOG_LOAD 0x40058004u
#define WATCHDOG_REASON 0x40058008u
#define WATCHDOG_SCRATCH(index) (0x4005800cu + 4u * (uint32_t)(index))
#define WATCHDOG_TICK 0x4005802cu

/* 4.10.13 */
#define SSI_CTRLR0 0x18000000u
#define SSI_SSIENR 0x18000008u
#define SSI_SER 0x18000010u
#define SSI_BAUDR 0x18000014u
#define SSI_SR 0x18000028u
#define SSI_DR0 0x18000060u
enum ssi {
    SSI_CTRLR0_BYTES_BOTH_WAYS = 7 << 16, /* frames of 8 bits, sent and received */
    SSI_SR_RX_ANY = 1 << 3,
};

/* 2.10.7 */
#define BROWN_OUT 0x40064004u
#define CHIP_RESET 0x40064008u

/* ARMv6-M */
#define SYSTICK_CONTROL 0xe000e010u
#define SYSTICK_RELOAD 0xe000e014u
#define SYSTICK_VALUE 0xe000e018u
enum systick {
    SYSTICK_ENABLE = 1 << 0,
    SYSTICK_INTERRUPT = 1 << 1,
    SYSTICK_FROM_PROCESSOR = 1 << 2,
};
#define NVIC_ENABLE 0xe000e100u
#define NVIC_PRIORITY(interrupt) (0xe000e400u + ((uint32_t)(interrupt) & ~3u))
#define SCB_VTOR 0xe000ed08u
#define SCB_SHPR3 0xe000ed20u
enum interrupt {
    INTERRUPT_TIMER0 = 0,
    INTERRUPT_USB = 5,
    INTERRUPT_IO_BANK0 = 13,
    INTERRUPT_UART0 = 20,
};

static inline uint32_t interrupts_mask(void)
{
    uint32_t before;
    __asm__ volatile("mrs %0, primask\n\tcpsid i" : "=r"(before)::"memory");
    return before;
}

static inline void interrupts_restore(uint32_t before)
{
    __asm__ volatile("msr primask, %0" ::"r"(before) : "memory");
}

#endif

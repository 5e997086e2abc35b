/* I2C0 as the only master of its bus, at 400 kHz: the bus of the set-point converter. No function waits for ever. */
#ifndef I2C_H
#define I2C_H

#include <stdbool.h>
#include <stdint.h>

enum { I2C_FIFO = 16 };

/* From the main loop, at start and after an error. A device that was cut off in the middle of a byte holds the data
 * line low until it has had its clocks: it gets them here. */
void i2c_restart(void);

/* Is nothing queued and nothing on the wires? False before i2c_restart. From any context. */
bool i2c_idle(void);

/* Send these bytes, at most I2C_FIFO, to the device and return at once; false if the bus is busy. From any context. */
bool i2c_post(const uint8_t *bytes, uint32_t count);

/* The same from the main loop, waiting for the end; false where the device does not acknowledge each byte in time. */
bool i2c_write(const uint8_t *bytes, uint32_t count);

/* Any number of bytes from the device, likewise. */
bool i2c_read(uint8_t *bytes, uint32_t count);

enum i2c_progress {
    I2C_UNDER_WAY,
    I2C_DONE,
    I2C_REFUSED,
};

/* The same without waiting: start, if the bus is idle, and go on until it is done. To give it up, i2c_restart. */
bool i2c_start_read(void);
enum i2c_progress i2c_go_on(uint8_t *bytes, uint32_t count);

#endif

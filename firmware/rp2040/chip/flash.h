/* The flash as a chip that takes commands. From flash_take_over on nothing of it can be read as memory, and nothing has to be:
 * all that runs then runs in RAM, so that no interrupt has to be masked while the flash is busy. */
#ifndef FLASH_H
#define FLASH_H

#include <stdint.h>

enum { FLASH_ADDRESS_BYTES = 3 };

/* Once, by code that runs in RAM. */
void flash_take_over(void);

/* A command: begin with its byte, exchange the others, end. No byte is waited for without bound. */
void flash_begin(uint32_t command);
void flash_begin_at(uint32_t command, uint32_t address);
uint32_t flash_exchange(uint32_t byte);
void flash_end(void);

#endif

/* Records in a sector of the flash behind the image, which outlast a start and a new image. Each is written behind the one
 * before; none is ever erased: an erased sector would be a board that has never stored anything. */
#ifndef FLASH_RECORDS_H
#define FLASH_RECORDS_H

#include <stdbool.h>
#include <stdint.h>

#include "port.h"

/* As port_read_stored and port_store, in 20 ms at most. */
bool flash_records_read(uint32_t words[STORED_WORDS]);
void flash_records_append(const uint32_t words[STORED_WORDS]);

#endif

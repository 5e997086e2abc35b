/* What somebody may do to the laboratory while the core runs; one line each, answered by "done" or "unknown".
 *
 *     interlock 0|1       open or close the interlock
 *     estop 0|1           open or close the emergency stop
 *     converter 0|1       the set-points cannot be confirmed as zero, or can be again
 *     trigger             a rising edge on the trigger input
 *     reset [watchdog]    restart the microcontroller
 *     advance MS          let time pass
 *     garbage HEX         bytes that reach the host computer, from nowhere
 *     noise HEX           bytes that reach the generator, from nowhere
 *     lose N              the next N replies vanish
 *     damage N            a bit of each of the next N replies flips */
#ifndef CONTROL_H
#define CONTROL_H

#include "protocol.h"

void control_run(struct protocol *protocol, const char *line);

#endif

/* The image in RAM: code and constants, which nothing may change. */
#ifndef IMAGE_CHECK_H
#define IMAGE_CHECK_H

#include <stdbool.h>

/* From the main loop: look at the next few words. */
void image_check_poll(void);

/* False from the end of the first round on that has found a change. */
bool image_check_intact(void);

#endif

/* Which board this is. */
#ifndef IDENTITY_H
#define IDENTITY_H

/* Once, after flash_take_over. */
void identity_read_board(void);

/* Its number, as port_serial. */
const char *identity_serial(void);

#endif

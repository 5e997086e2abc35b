/* Which board this is. */
#ifndef IDENTITY_H
#define IDENTITY_H

/* Once, by the code that runs in RAM: while it asks the flash for its number, nobody can read from it. */
void identity_read_board(void);

/* Its number, as port_serial. */
const char *identity_serial(void);

#endif

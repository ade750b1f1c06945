/* The fields of a command one after the other, and the beginnings of its reply. */
#ifndef FIELDS_H
#define FIELDS_H

#include "board.h"

/* Begin with the first field; words stand one after the other, each ended by a 0, and the first is the command. */
void fields_begin(const char *tag, const char *command, uint8_t words);

/* Begin the reply to the command. */
void reply(const __flash char *text);

/* Begin a reply that refuses; its word is to follow. */
void refuse(const __flash char *name);

/* Write a word of the host into the line: shortened, and up to its `=` if it is a field. */
void line_word(const char *word, bool of_field);

/* The next field, or 0 if none is left. */
const char *next_field(void);

/* What refuses returns true, and has sent the reply then. A field that is missing is 0. */
bool refuse_field(const char *wrong);

/* Refuse if a field is left. */
bool refuse_surplus(void);

/* Take the next field, which must be `name` and so many hexadecimal digits. */
bool refuse_hex(const char *name, uint8_t digits, uint32_t *value);

#endif

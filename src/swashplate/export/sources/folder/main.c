/* An example: two seconds of a constant command, a line for every tenth of a second. */
#include "@file@.h"
#include "@name@_values.h"

#include <stdio.h>

static @type@ model; /* some kilobytes: better not on a small stack */

int main(void)
{
    int status = @p@_init(&model, @name@_values, sizeof @name@_values / sizeof @name@_values[0]);
    const long samples = (long)(2.0 / @p@_get_step(&model));
    const long every = samples >= 20 ? samples / 20 : 1;
    for (long n = 0; n <= samples && status == @P@_OK; n++) {
        status = @p@_step(&model@commands@);
        if (n % every == 0) {
            printf("%8.4f %.9g\n", (double)n * @p@_get_step(&model),
                @p@_output(&model, @P@_@output@));
        }
    }
    if (status != @P@_OK) {
        fprintf(stderr, "%s\n", @p@_sentence(status));
    }
    return status;
}

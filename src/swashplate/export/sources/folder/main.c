/* An example: two seconds of a constant command, a line about every tenth of a second. */
#include "@file@.h"
#include "@name@_values.h"

#include <stdio.h>

static @type@ model; /* some kilobytes: better not on a small stack */

int main(void)
{
    int status = @p@_init(&model, @name@_values, sizeof @name@_values / sizeof @name@_values[0]);
    if (status != @P@_OK) {
        fprintf(stderr, "%s\n", @p@_sentence(status));
        return status;
    }
    const double step = @p@_get_step(&model); /* [s] */
    const long samples = (long)(2.0 / step);
    const long every = samples >= 20 ? samples / 20 : 1;
    for (long n = 0; n <= samples; n++) {
        status = @p@_step(&model@commands@);
        if (status != @P@_OK) {
            fprintf(stderr, "%8.4f s: %s\n", (double)n * step, @p@_sentence(status));
            return status;
        }
        if (n % every == 0) {
            printf("%8.4f %.9g\n", (double)n * step, @p@_output(&model, @output@));
        }
    }
    return 0;
}

/* The FMU as one unit, of which FMI's functions alone are seen outside. Their names begin with the
 * model's identifier, as the standard has it for source code; an importer that makes a shared
 * library defines FMI@n@_FUNCTION_PREFIX itself as nothing, or FMI@n@_OVERRIDE_FUNCTION_PREFIX. */
#if !defined(FMI@n@_FUNCTION_PREFIX) && !defined(FMI@n@_OVERRIDE_FUNCTION_PREFIX)
#define FMI@n@_FUNCTION_PREFIX @identifier@_
#endif
#define SWP_API static inline
#define SWP_FMU_API static inline

#include "@model@"
#include "fmi.c"
#include "fmi@n@.c"

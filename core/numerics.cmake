# The flags that fix bits, and the warnings; included by the main build and by tests/matrix, so that
# both compile the engine alike.
#
# Numerics flags are PUBLIC on core and io, so that no consumer can compute other bits. Contraction
# must be off explicitly: g++ 12 fuses a*b+c under -std=c++20 as soon as the target has FMA.
# -fno-math-errno and -fno-trapping-math change no value: they only tell the compiler that nobody
# reads errno or the exception flags.
add_library(varve_numerics INTERFACE)
target_compile_options(varve_numerics INTERFACE
  -ffp-contract=off -fno-math-errno -fno-trapping-math)

# For our own sources only. g++ 12 sees overlapping copies in "text" + std::string() where there are
# none (its bug 105651).
add_library(varve_warnings INTERFACE)
target_compile_options(varve_warnings INTERFACE
  -Wall -Wextra -Wpedantic -Wconversion -Wshadow
  $<$<CXX_COMPILER_ID:GNU>:-Wno-restrict> $<$<BOOL:${VARVE_WERROR}>:-Werror>)

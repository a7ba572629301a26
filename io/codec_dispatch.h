// Inner loops exist once in the source, forced inline into wrappers that only differ in the
// instructions they may use; the wrapper is chosen when the program runs. Chosen by hand, this
// works with every sanitizer, which ifunc resolvers do not. All loops are element-wise or in
// integers, so that the choice cannot reach a bit.
#pragma once

#if defined(__x86_64__) && defined(__GNUC__)
#define VARVE_CODEC_X86 1
#endif

/// A body that is compiled for the instructions of its caller.
#define VARVE_INLINE inline __attribute__((always_inline))

# cmake -C tests/presets/asan.cmake -B build-asan: AddressSanitizer and UndefinedBehaviorSanitizer,
# every finding fatal. float-cast-overflow is not part of `undefined`.
set(CMAKE_BUILD_TYPE None CACHE STRING "")
set(VARVE_SANITIZERS -fsanitize=address,undefined,float-cast-overflow)
set(CMAKE_CXX_FLAGS
    "-O1 -g -fno-omit-frame-pointer ${VARVE_SANITIZERS} -fno-sanitize-recover=all" CACHE STRING "")

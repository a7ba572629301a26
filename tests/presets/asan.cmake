# cmake -C tests/presets/asan.cmake -B build-asan: AddressSanitizer and UndefinedBehaviorSanitizer,
# every finding fatal. float-cast-overflow and float-divide-by-zero are not part of `undefined`.
set(CMAKE_BUILD_TYPE None CACHE STRING "")
set(CMAKE_CXX_FLAGS
    "-O1 -g -fno-omit-frame-pointer -fsanitize=address,undefined,float-cast-overflow -fno-sanitize-recover=all"
    CACHE STRING "")

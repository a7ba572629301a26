# cmake -C tests/presets/tsan.cmake -B build-tsan: ThreadSanitizer.
set(CMAKE_BUILD_TYPE None CACHE STRING "")
set(CMAKE_CXX_FLAGS "-O1 -g -fno-omit-frame-pointer -fsanitize=thread" CACHE STRING "")

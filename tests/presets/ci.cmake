# cmake -C tests/presets/ci.cmake -B build-ci: release, and a warning is an error.
set(CMAKE_BUILD_TYPE Release CACHE STRING "")
set(VARVE_WERROR ON CACHE BOOL "")

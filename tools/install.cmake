# What `cmake --install` puts where, and what find_package(varve) then offers: varve::io (the log),
# varve::core (the engine), varve::tools (recording, replaying and forking any engine), the verbs
# and the scenes. Headers keep their folders: #include "io/log_writer.h".
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

set(varve_include_dir ${CMAKE_INSTALL_INCLUDEDIR}/varve)
set(varve_package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/varve)

# The interfaces; other headers are details of their libraries.
set(varve_public_headers
  core/assessment.h core/criteria.h core/kernel_names.h core/parameters.h core/scenario.h
  core/simulation.h core/units.h
  io/digest.h io/engine.h io/errors.h io/file.h io/frame.h io/frame_diff.h io/genesis.h io/limits.h
  io/log_reader.h io/log_writer.h io/memory_file.h io/ulp.h
  tools/cli.h tools/recording.h tools/steps.h)
# What they include of ours goes with them.
set(open ${varve_public_headers})
while(open)
  list(POP_FRONT open header)
  file(STRINGS ${PROJECT_SOURCE_DIR}/${header} lines REGEX "^#include \"(core|io|tools)/")
  foreach(line IN LISTS lines)
    string(REGEX REPLACE "^#include \"([^\"]+)\".*" "\\1" included "${line}")
    if(NOT included IN_LIST varve_public_headers)
      list(APPEND varve_public_headers ${included})
      list(APPEND open ${included})
    endif()
  endforeach()
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/${header})
endwhile()
foreach(header IN LISTS varve_public_headers)
  get_filename_component(folder ${header} DIRECTORY)
  install(FILES ${PROJECT_SOURCE_DIR}/${header} DESTINATION ${varve_include_dir}/${folder}
          COMPONENT development)
endforeach()

foreach(target IN ITEMS io core tool)
  target_include_directories(varve_${target} INTERFACE $<INSTALL_INTERFACE:${varve_include_dir}>)
endforeach()
set_target_properties(varve_core PROPERTIES EXPORT_NAME core)
set_target_properties(varve_io PROPERTIES EXPORT_NAME io)
set_target_properties(varve_tool PROPERTIES EXPORT_NAME tools)
set_target_properties(varve_schema PROPERTIES EXPORT_NAME schema)
set_target_properties(varve_numerics PROPERTIES EXPORT_NAME numerics)
set_target_properties(varve_warnings PROPERTIES EXPORT_NAME warnings)
# The last one is empty for a consumer: private flags of a library reach nobody who links it.
install(TARGETS varve_core varve_io varve_tool varve_schema varve_numerics varve_warnings
        EXPORT varve-targets
        ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT development)
install(EXPORT varve-targets NAMESPACE varve:: DESTINATION ${varve_package_dir}
        COMPONENT development)

configure_package_config_file(${CMAKE_CURRENT_LIST_DIR}/varve-config.cmake.in
  ${PROJECT_BINARY_DIR}/varve-config.cmake INSTALL_DESTINATION ${varve_package_dir}
  NO_SET_AND_CHECK_MACRO)
# Before 1.0 a minor version may change an interface.
write_basic_package_version_file(${PROJECT_BINARY_DIR}/varve-config-version.cmake
  COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/varve-config.cmake
              ${PROJECT_BINARY_DIR}/varve-config-version.cmake
        DESTINATION ${varve_package_dir} COMPONENT development)

# The verbs find each other beside themselves, so they stay in one folder.
install(TARGETS varve ${varve_verbs} RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT tools)
install(DIRECTORY ${PROJECT_SOURCE_DIR}/scenarios/
        DESTINATION ${CMAKE_INSTALL_DATADIR}/varve/scenarios COMPONENT tools
        FILES_MATCHING PATTERN *.cfg)
install(FILES ${PROJECT_SOURCE_DIR}/io/FORMAT.md ${PROJECT_SOURCE_DIR}/io/CODEC.md
              ${PROJECT_SOURCE_DIR}/core/PHYSICS.md
        DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT tools)

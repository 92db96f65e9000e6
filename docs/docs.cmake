# Target `docs`: pages of the C++ interfaces, in docs/html of the build folder. Not part of a build; only where Doxygen is found.
find_package(Doxygen QUIET OPTIONAL_COMPONENTS dot)
if(DOXYGEN_FOUND)
  set(TENON_DOXYGEN_DOT NO)
  if(TARGET Doxygen::dot)
    set(TENON_DOXYGEN_DOT YES)
  endif()
  configure_file(docs/Doxyfile.in docs/Doxyfile @ONLY)
  add_custom_target(docs COMMAND Doxygen::doxygen docs/Doxyfile WORKING_DIRECTORY ${CMAKE_BINARY_DIR} VERBATIM
                    COMMENT "API pages: ${CMAKE_BINARY_DIR}/docs/html/index.html")
endif()

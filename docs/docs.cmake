# Target `docs`: pages of the C++ interfaces, in docs/html of the build folder. Not part of a build; only where Doxygen is found.
find_package(Doxygen QUIET)
if(DOXYGEN_FOUND)
  configure_file(docs/Doxyfile.in docs/Doxyfile @ONLY)
  add_custom_target(docs COMMAND Doxygen::doxygen docs/Doxyfile WORKING_DIRECTORY ${CMAKE_BINARY_DIR} VERBATIM
                    COMMENT "API pages: ${CMAKE_BINARY_DIR}/docs/html/index.html")
endif()

# The console's page, and that of reports, built with Node where there is one; without them gateway and report say what is missing. Its libraries are those of
# package-lock.json, and what is built contains them: nothing is needed when it runs.
find_program(NODE node)
find_program(NPM npm)
set(page_source ${CMAKE_CURRENT_LIST_DIR})
set(page_protocol ${CMAKE_SOURCE_DIR}/idl/types/messages/session.h)
set(page_folder ${CMAKE_BINARY_DIR}/console_page)
set(report_page_folder ${CMAKE_BINARY_DIR}/report_page)
if(NODE AND NPM)
  file(GLOB_RECURSE page_sources CONFIGURE_DEPENDS ${page_source}/src/* ${page_source}/*.json ${page_source}/*.html ${page_source}/*.ts)
  list(FILTER page_sources EXCLUDE REGEX "/node_modules/")
  add_custom_command(OUTPUT ${page_folder}/built COMMAND ${CMAKE_COMMAND} -D NPM=${NPM} -D NODE=${NODE} -D SOURCE=${page_source} -D PAGE=${page_folder} -D REPORT=${report_page_folder}
                     -D WORK=${CMAKE_BINARY_DIR}/console_page_build -D PROTOCOL=${page_protocol} -P ${page_source}/build_page.cmake
                     DEPENDS ${page_sources} ${page_protocol} ${page_source}/build_page.cmake ${page_source}/.npmrc VERBATIM COMMENT "Building the pages of console and report")
  add_custom_target(console_page DEPENDS ${page_folder}/built)
  add_dependencies(programs console_page)
else()
  message(STATUS "the console's page is not built: it needs node and npm, which `deploy/setup console` installs")
endif()

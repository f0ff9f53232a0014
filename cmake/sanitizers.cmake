# SPECTRA_SANITIZE is a list such as "address;undefined" or "thread"; it applies to everything that is built.
if(SPECTRA_SANITIZE)
  list(JOIN SPECTRA_SANITIZE "," sanitizers)
  add_compile_options(-fsanitize=${sanitizers} -fno-omit-frame-pointer)
  add_link_options(-fsanitize=${sanitizers})
  if("undefined" IN_LIST SPECTRA_SANITIZE)
    add_compile_options(-fsanitize=float-cast-overflow,float-divide-by-zero -fno-sanitize-recover=all)
    add_link_options(-fsanitize=float-cast-overflow,float-divide-by-zero)
  endif()
  if("thread" IN_LIST SPECTRA_SANITIZE)
    # ThreadSanitizer does not understand the fences of Asio.
    add_compile_definitions(BOOST_ASIO_DISABLE_FENCED_BLOCK)
  endif()
endif()

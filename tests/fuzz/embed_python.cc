// A fuzzer of loaders that are written in Python: hands every input to function fuzz() of a module
// in this folder, SGF_FUZZ_MODULE, which raises for a finding. libFuzzer sees which lines an input
// takes, of the project and of Python's libraries alike.

#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include <sanitizer/lsan_interface.h>
#include <stdlib.h>

#include "fuzz/fuzz_input.h"

namespace {

// What libFuzzer takes for counters of branches, by its section.
__attribute__((section("__libfuzzer_extra_counters"))) uint8_t line_counters[1 << 15];

int CountLine(PyObject*, PyFrameObject* frame, int event, PyObject*) {
  if (event != PyTrace_LINE) return 0;
  PyCodeObject* code = PyFrame_GetCode(frame);
  const auto file = static_cast<size_t>(PyObject_Hash(code->co_filename));
  const auto line = static_cast<size_t>(PyFrame_GetLineNumber(frame));
  uint8_t& counter = line_counters[(file * 1000003 + line * 40503) % sizeof(line_counters)];
  if (counter < 255) ++counter;
  Py_DECREF(code);
  return 0;
}

template <class T>
T* OrAbort(T* object) {
  if (object != nullptr) return object;
  PyErr_Print();
  abort();
}

void OrAbort(PyStatus status) {
  if (PyStatus_Exception(status)) Py_ExitStatusException(status);
}

// Every object has memory of its own from malloc(), so that the sanitizers see it.
void StartInterpreter() {
  PyPreConfig memory;
  PyPreConfig_InitIsolatedConfig(&memory);
  memory.allocator = PYMEM_ALLOCATOR_MALLOC;
  memory.utf8_mode = 1;
  OrAbort(Py_PreInitialize(&memory));
  PyConfig config;
  PyConfig_InitIsolatedConfig(&config);
  config.use_hash_seed = 1;  // the same counters for the same lines in every run
  config.hash_seed = 0;
  config.write_bytecode = 0;
  config.faulthandler =
      1;  // says where it was; then libFuzzer's handler, installed before, takes over
  OrAbort(PyConfig_SetBytesString(&config, &config.program_name, SGF_PYTHON));
  OrAbort(Py_InitializeFromConfig(&config));
  PyConfig_Clear(&config);
}

// The function, in an interpreter that is never ended. What it holds from its start on is in part
// out of the leak sanitizer's sight.
PyObject* LoadFuzz() {
  const __lsan::ScopedDisabler at_start;
  StartInterpreter();
  PyObject* path = OrAbort(PySys_GetObject("path"));
  for (const char* folder : {SGF_PROJECT "/paper", SGF_PROJECT "/tests/fuzz"}) {
    PyObject* text = OrAbort(PyUnicode_FromString(folder));
    if (PyList_Insert(path, 0, text) != 0) abort();
    Py_DECREF(text);
  }
  PyObject* fuzz =
      OrAbort(PyObject_GetAttrString(OrAbort(PyImport_ImportModule(SGF_FUZZ_MODULE)), "fuzz"));
  PyRun_SimpleString("import gc; gc.freeze()");  // what is there now is left out of collections
  PyEval_SetTrace(CountLine, nullptr);
  return fuzz;
}

}  // namespace

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static PyObject* const fuzz = LoadFuzz();
  const sgf::ProcessorTimeLimit limit(10);
  Py_DECREF(OrAbort(PyObject_CallFunction(fuzz, "y#", data, static_cast<Py_ssize_t>(size))));
  PyGC_Collect();
  return 0;
}

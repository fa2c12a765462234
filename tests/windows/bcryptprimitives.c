/* Stands in for a library of Windows that wine 8 lacks: Rust's standard library takes its random numbers from there. For tests alone. */
#include <windows.h>

BOOLEAN NTAPI SystemFunction036(PVOID memory, ULONG length);

__declspec(dllexport) BOOL WINAPI ProcessPrng(PBYTE memory, SIZE_T length) {
    return SystemFunction036(memory, (ULONG)length);
}

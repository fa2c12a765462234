/* Presses Ctrl-C at a program after some time. Usage: interrupt MILLISECONDS PROGRAM ARGUMENTS...; its exit code is the program's. */
#include <stdio.h>
#include <stdlib.h>
#include <wchar.h>
#include <windows.h>

int main(void) {
    /* The rest of the own command line, as it was typed: the program, then its arguments. */
    wchar_t *line = GetCommandLineW();
    BOOL quoted = FALSE;
    while (*line && (quoted || *line != L' ')) quoted ^= *line++ == L'"';
    while (*line == L' ') line++;
    unsigned long wait = wcstoul(line, &line, 10);
    while (*line == L' ') line++;

    /* A program that was not started from a console has none, and Ctrl-C goes to those of one console. */
    FreeConsole();
    AllocConsole();

    STARTUPINFOW start = {.cb = sizeof start};
    PROCESS_INFORMATION child;
    if (!CreateProcessW(NULL, line, NULL, NULL, TRUE, 0, NULL, NULL, &start, &child)) {
        fprintf(stderr, "interrupt: not started, error %lu\n", GetLastError());
        return 99;
    }
    if (WaitForSingleObject(child.hProcess, wait) != WAIT_TIMEOUT) {
        fprintf(stderr, "interrupt: it had ended before\n");
        return 98;
    }
    /* To all that share this console, but for this program. */
    SetConsoleCtrlHandler(NULL, TRUE);
    if (!GenerateConsoleCtrlEvent(CTRL_C_EVENT, 0)) {
        fprintf(stderr, "interrupt: not sent, error %lu\n", GetLastError());
        TerminateProcess(child.hProcess, 97);
    }
    if (WaitForSingleObject(child.hProcess, 60000) == WAIT_TIMEOUT) {
        fprintf(stderr, "interrupt: it does not end\n");
        TerminateProcess(child.hProcess, 96);
        WaitForSingleObject(child.hProcess, 5000);
    }
    DWORD code = 95;
    GetExitCodeProcess(child.hProcess, &code);
    return (int)code;
}

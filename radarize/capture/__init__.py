"""Live capture from a real radar: configured over UART, streamed by a DCA1000 over UDP, recorded or processed live.

sensor (radar and board, in the correct order)  ->  uart (mmwDemo's command line), board (the DCA1000's commands)
                                             ->  stream (a process that fills a ring), of it: receiver or replay
record (stream to file)    live (stream to pipeline), shown by view (pictures) and page (a local web page)
"""

!> Does the search for data races work here? With an argument this program has one, without it none.
!> Each thread has its part of the racing loop, so that it is found on a single processor too.
program race_probe
  implicit none (type, external)
  integer :: i, total, number(1000)
  logical :: race

  race = command_argument_count() > 0
  total = 0
  !$omp parallel default(none) shared(number, race, total)
  !$omp do schedule(static)
  do i = 1, size(number)
    number(i) = i
    if (race) total = total + i
  end do
  !$omp end do
  !$omp do schedule(dynamic) reduction(+:total)
  do i = 1, size(number)
    total = total + number(size(number) + 1 - i)
  end do
  !$omp end do
  !$omp end parallel
  print '(i0)', total
end program race_probe

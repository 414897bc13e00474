!> What the machine can do at best, measured here and now: bytes per second from memory and
!> operations per second in registers.
module pd_study_bench_machine
  use pd_base_clock, only: wall_time
  use pd_base_kinds, only: wp, i8
  implicit none (type, external)
  private
  public :: machine_type, measure_machine, processor_time

  !> Best of some repeats, with a number of threads.
  type :: machine_type
    integer :: threads = 1
    real(wp) :: bandwidth = 0.0_wp   !! of a = b + s c on long arrays, 24 bytes an element [bytes/s]
    real(wp) :: peak = 0.0_wp        !! multiply-adds in registers, two operations each [1/s]
  end type machine_type

  integer, parameter :: lanes = 8            !! elements of an accumulator
  integer, parameter :: inner = 20000        !! multiply-adds of a chain in a round
  real(wp), parameter :: shrink = 0.999_wp, shift = 0.001_wp  !! of the chains: they stay near 1

contains

  !> Measure with `threads` threads. `length`: elements of each of the three arrays; they must
  !> exceed the caches by far. `repeats`: the best of so many counts, since other work can only make
  !> things slower.
  subroutine measure_machine(threads, length, repeats, machine)
    integer, intent(in) :: threads              !! number of threads that work at once
    integer, intent(in) :: repeats              !! measurements, of which the best counts
    integer(i8), intent(in) :: length           !! elements of each of the three arrays
    type(machine_type), intent(out) :: machine  !! bandwidth and peak of these threads

    machine%threads = threads
    call measure_bandwidth(threads, length, repeats, machine%bandwidth)
    call measure_peak(threads, repeats, machine%peak)
  end subroutine measure_machine

  !> The triad a = b + s c. Memory traffic that the hardware adds (reading a before it is written)
  !> is not counted, as is usual.
  subroutine measure_bandwidth(threads, length, repeats, bandwidth)
    integer, intent(in) :: threads, repeats
    integer(i8), intent(in) :: length
    real(wp), intent(out) :: bandwidth
    real(wp), allocatable :: a(:), b(:), c(:)
    real(wp) :: begin, best
    integer(i8) :: i
    integer :: r

    allocate (a(length), b(length), c(length))
    ! each thread first touches its own part of the memory
    !$omp parallel do schedule(static) num_threads(threads) default(none) &
    !$omp shared(a, b, c, length) private(i)
    do i = 1, length
      a(i) = 0.0_wp
      b(i) = 1.0_wp
      c(i) = 2.0_wp
    end do
    best = huge(best)
    do r = 1, repeats
      begin = wall_time()
      !$omp parallel do simd schedule(static) num_threads(threads) default(none) &
      !$omp shared(a, b, c, length, r) private(i)
      do i = 1, length
        a(i) = b(i) + r*c(i)
      end do
      best = min(best, wall_time() - begin)
    end do
    bandwidth = 24*real(length, wp)/max(best, tiny(best))
    ! a result that nobody reads need not be computed
    if (abs(a(length) - (1 + 2*repeats)) > 0.0_wp) bandwidth = 0.0_wp
  end subroutine measure_bandwidth

  !> Independent chains of multiply-adds. How many hide the latency, and how many fit into the
  !> registers, depends on the processor: the better of few and many counts.
  subroutine measure_peak(threads, repeats, peak)
    integer, intent(in) :: threads, repeats
    real(wp), intent(out) :: peak
    real(wp) :: few, many

    call measure_chains(threads, repeats, 6, few)
    call measure_chains(threads, repeats, 12, many)
    peak = max(few, many)
  end subroutine measure_peak

  !> Operations per second with `number` (6 or 12) times `lanes` chains.
  subroutine measure_chains(threads, repeats, number, rate)
    integer, intent(in) :: threads, repeats, number
    real(wp), intent(out) :: rate
    real(wp) :: begin, seconds, best, sums
    integer :: r, t
    integer(i8) :: rounds

    rounds = 1_i8
    best = huge(best)
    r = 0
    do while (r < repeats)
      sums = 0.0_wp
      begin = wall_time()
      !$omp parallel do schedule(static, 1) num_threads(threads) default(none) &
      !$omp shared(threads, rounds, number) private(t) reduction(+:sums)
      do t = 1, threads
        if (number == 6) then
          sums = sums + six_chains(rounds)
        else
          sums = sums + twelve_chains(rounds)
        end if
      end do
      seconds = wall_time() - begin
      ! the sum is asked for so that nothing can be left out
      if (sums <= 0.0_wp) exit
      if (seconds < 0.02_wp) then
        rounds = 4*rounds
        cycle
      end if
      r = r + 1
      best = min(best, seconds/real(rounds, wp))
    end do
    rate = 2*number*real(lanes, wp)*inner*threads/best
  end subroutine measure_chains

  !> `rounds*inner` multiply-adds in each of six times `lanes` chains.
  function six_chains(rounds) result(total)
    integer(i8), intent(in) :: rounds
    real(wp) :: total
    real(wp) :: a(lanes), b(lanes), c(lanes), d(lanes), e(lanes), f(lanes)
    integer(i8) :: r
    integer :: i, l

    a = 1.0_wp
    b = 1.1_wp
    c = 1.2_wp
    d = 1.3_wp
    e = 1.4_wp
    f = 1.5_wp
    do r = 1, rounds
      do i = 1, inner
        !$omp simd
        do l = 1, lanes
          a(l) = a(l)*shrink + shift
          b(l) = b(l)*shrink + shift
          c(l) = c(l)*shrink + shift
          d(l) = d(l)*shrink + shift
          e(l) = e(l)*shrink + shift
          f(l) = f(l)*shrink + shift
        end do
      end do
    end do
    total = sum(a + b + c + d + e + f)
  end function six_chains

  !> The same with twelve.
  function twelve_chains(rounds) result(total)
    integer(i8), intent(in) :: rounds
    real(wp) :: total
    real(wp) :: a(lanes), b(lanes), c(lanes), d(lanes), e(lanes), f(lanes)
    real(wp) :: g(lanes), h(lanes), o(lanes), p(lanes), q(lanes), s(lanes)
    integer(i8) :: r
    integer :: i, l

    a = 1.0_wp
    b = 1.1_wp
    c = 1.2_wp
    d = 1.3_wp
    e = 1.4_wp
    f = 1.5_wp
    g = 1.6_wp
    h = 1.7_wp
    o = 1.8_wp
    p = 1.9_wp
    q = 2.0_wp
    s = 2.1_wp
    do r = 1, rounds
      do i = 1, inner
        !$omp simd
        do l = 1, lanes
          a(l) = a(l)*shrink + shift
          b(l) = b(l)*shrink + shift
          c(l) = c(l)*shrink + shift
          d(l) = d(l)*shrink + shift
          e(l) = e(l)*shrink + shift
          f(l) = f(l)*shrink + shift
          g(l) = g(l)*shrink + shift
          h(l) = h(l)*shrink + shift
          o(l) = o(l)*shrink + shift
          p(l) = p(l)*shrink + shift
          q(l) = q(l)*shrink + shift
          s(l) = s(l)*shrink + shift
        end do
      end do
    end do
    total = sum(a + b + c + d + e + f + g + h + o + p + q + s)
  end function twelve_chains

  !> Processor time of all threads of this program so far [s].
  function processor_time() result(seconds)
    real(wp) :: seconds
    call cpu_time(seconds)
  end function processor_time

end module pd_study_bench_machine
